#include "ranks/mpi_ranks.h"

extern "C" __attribute__((visibility("default"))) const isobrick::MpiModule* isobrick_module() {
  static constexpr isobrick::MpiModule module{ISOBRICK_VERSION, isobrick::join_mpi};
  return &module;
}

#include "io/volumes/hdf5/hdf5_volume.h"
#include "io/volumes/open/module_loader.h"

extern "C" __attribute__((visibility("default"))) const isobrick::Hdf5Module* isobrick_module() {
  static constexpr isobrick::Hdf5Module module{ISOBRICK_VERSION, isobrick::open_hdf5};
  return &module;
}

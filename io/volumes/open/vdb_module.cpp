#include "io/volumes/open/module_loader.h"
#include "io/volumes/vdb/vdb_volume.h"

extern "C" __attribute__((visibility("default"))) const isobrick::VdbModule* isobrick_module() {
  static constexpr isobrick::VdbModule module{ISOBRICK_VERSION, isobrick::open_vdb,
                                              isobrick::make_vdb_writer,
                                              isobrick::make_vdb_level_set};
  return &module;
}

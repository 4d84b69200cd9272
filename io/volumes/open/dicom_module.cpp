#include "io/volumes/dicom/dicom_volume.h"
#include "io/volumes/open/module_loader.h"

extern "C" __attribute__((visibility("default"))) const isobrick::DicomModule* isobrick_module() {
  static constexpr isobrick::DicomModule module{ISOBRICK_VERSION, isobrick::open_dicom};
  return &module;
}

#include "io/volumes/open/module_loader.h"

#include "io/bytes/module.h"

namespace isobrick::inline v0 {

const Hdf5Module& hdf5_module() {
  static const auto& module = load_module<Hdf5Module>("hdf5", "HDF5 files");
  return module;
}

const DicomModule& dicom_module() {
  static const auto& module = load_module<DicomModule>("dicom", "DICOM files");
  return module;
}

const VdbModule& vdb_module() {
  static const auto& module = load_module<VdbModule>("openvdb", "OpenVDB files");
  return module;
}

}  // namespace isobrick

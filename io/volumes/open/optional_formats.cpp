#include "io/volumes/open/optional_formats.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/volumes/open/module_loader.h"
#include "io/volumes/vdb/vdb_level_set.h"
#include "io/volumes/vdb/vdb_writer.h"
#ifdef ISOBRICK_WITH_EXPAT
#include "io/volumes/vtk/vti_volume.h"
#endif
#ifdef ISOBRICK_WITH_TIFF
#include "io/volumes/tiff/tiff_volume.h"
#endif

namespace isobrick::inline v0 {
namespace {

[[noreturn, maybe_unused]] void built_without(const std::string& name, const char* format,
                                              const char* library) {
  throw UsageError(
      fmt::format("'{}' is {}, which this isobrick cannot read: it was built without {}", name,
                  format, library));
}

[[noreturn, maybe_unused]] void cannot_write_vdb() {
  throw UsageError(
      "this isobrick cannot write OpenVDB files: it was built without "
      "libopenvdb-dev and libboost-dev");
}

}  // namespace

std::unique_ptr<VolumeSource> open_vti_if_built(const std::string& file,
                                                [[maybe_unused]] const std::string& array,
                                                [[maybe_unused]] const VolumeRequest& request) {
#ifdef ISOBRICK_WITH_EXPAT
  return open_vti(file, array, request);
#else
  built_without(file, "a VTK image", "libexpat1-dev");
#endif
}

std::unique_ptr<VolumeSource> open_tiff_if_built(
    const std::string& name, [[maybe_unused]] const std::vector<std::string>& files,
    [[maybe_unused]] const VolumeRequest& request) {
#ifdef ISOBRICK_WITH_TIFF
  return open_tiff(name, files, request);
#else
  built_without(name, "a TIFF stack", "libtiff-dev 4.5");
#endif
}

std::unique_ptr<VolumeSource> open_hdf5_if_built(const std::string& file,
                                                 [[maybe_unused]] const std::string& dataset,
                                                 [[maybe_unused]] const VolumeRequest& request) {
#ifdef ISOBRICK_WITH_HDF5
  return hdf5_module().open(file, dataset, request);
#else
  built_without(file, "an HDF5 file", "libhdf5-dev");
#endif
}

std::unique_ptr<VolumeSource> open_vdb_if_built(const std::string& file,
                                                [[maybe_unused]] const VolumeRequest& request) {
#ifdef ISOBRICK_WITH_OPENVDB
  return vdb_module().open(file, request);
#else
  built_without(file, "an OpenVDB file", "libopenvdb-dev and libboost-dev");
#endif
}

std::unique_ptr<VdbWriter> make_vdb_writer_if_built([[maybe_unused]] const VolumeInfo& info,
                                                    [[maybe_unused]] const std::string& name,
                                                    [[maybe_unused]] std::uint64_t budget) {
#ifdef ISOBRICK_WITH_OPENVDB
  return vdb_module().make_writer(info, name, budget);
#else
  cannot_write_vdb();
#endif
}

std::unique_ptr<VdbLevelSet> make_vdb_level_set_if_built([[maybe_unused]] const VolumeInfo& info,
                                                         [[maybe_unused]] const std::string& name,
                                                         [[maybe_unused]] int half_band,
                                                         [[maybe_unused]] int threads,
                                                         [[maybe_unused]] std::uint64_t budget) {
#ifdef ISOBRICK_WITH_OPENVDB
  return vdb_module().make_level_set(info, name, half_band, threads, budget);
#else
  cannot_write_vdb();
#endif
}

std::unique_ptr<VolumeSource> open_dicom_if_built(
    const std::string& name, [[maybe_unused]] const std::vector<std::string>& files,
    [[maybe_unused]] const VolumeRequest& request) {
#ifdef ISOBRICK_WITH_DICOM
  return dicom_module().open(name, files, request);
#else
  built_without(name, "a DICOM series", "libdcmtk-dev");
#endif
}

}  // namespace isobrick

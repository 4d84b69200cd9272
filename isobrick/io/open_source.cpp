#include "isobrick/io/open_source.h"

#include <fmt/format.h>

#include "isobrick/core/error.h"
#include "isobrick/io/legacy_vtk.h"
#include "isobrick/io/nifti_volume.h"
#include "isobrick/io/raw_volume.h"
#include "isobrick/io/volume_format.h"

#ifdef ISOBRICK_WITH_EXPAT
#include "isobrick/io/vti_volume.h"
#endif

namespace isobrick {
namespace {

/// For a format whose library was not there when this was built.
[[noreturn, maybe_unused]] void built_without(const std::string& path, const char* format,
                                              const char* library) {
  throw UsageError(
      fmt::format("'{}' is {}, which this isobrick cannot read: it was built without {}", path,
                  format, library));
}

std::unique_ptr<VolumeSource> open_vtk_xml(const std::string& file,
                                           [[maybe_unused]] const std::string& array,
                                           [[maybe_unused]] const VolumeRequest& said) {
#ifdef ISOBRICK_WITH_EXPAT
  return open_vti(file, array, said);
#else
  built_without(file, "a VTK image", "libexpat1-dev");
#endif
}

std::unique_ptr<VolumeSource> open_file(VolumeFormat format, const std::string& file,
                                        const VolumeRequest& said) {
  switch (format) {
    case VolumeFormat::nrrd:
    case VolumeFormat::meta_image:
      return open_text_volume(parse_text_header(file, format == VolumeFormat::nrrd, said.selection),
                              said);
    case VolumeFormat::nifti: return open_nifti(file, said);
    case VolumeFormat::legacy_vtk: return open_legacy_vtk(file, said);
    default: return open_raw(file, said);
  }
}

}  // namespace

std::unique_ptr<VolumeSource> open_source(const std::string& path, const VolumeRequest& said) {
  if (path == "-") return open_stdin(said);
  const auto [file, inner] = split_volume_path(path);
  const VolumeFormat format = recognise_format(file);
  if (format == VolumeFormat::vti) return open_vtk_xml(file, inner, said);
  if (!inner.empty())
    throw UsageError(fmt::format("'{}' holds no arrays with names: leave ':/{}' out", file, inner));
  return open_file(format, file, said);
}

}  // namespace isobrick

#include <isobrick/open_source.h>

#include <fmt/format.h>

#include <filesystem>

#include <isobrick/error.h>
#include "io/volumes/open/optional_formats.h"
#include "io/volumes/open/volume_folder.h"
#include "io/volumes/open/volume_format.h"
#include "io/volumes/raw/nifti_volume.h"
#include "io/volumes/raw/raw_volume.h"
#include "io/volumes/selected_source.h"
#include "io/volumes/vtk/legacy_vtk.h"

namespace isobrick::inline v0 {
namespace {

/// The header replaces the options of raw samples, but for a byte order that it may lack.
std::unique_ptr<VolumeSource> open_with_text_header(VolumeFormat format, const std::string& file,
                                                    const VolumeRequest& request) {
  const bool nrrd = format == VolumeFormat::nrrd;
  VolumeRequest rest = request;
  rest.order.reset();
  refuse_raw_description(file, nrrd ? "a NRRD file" : "a MetaImage", rest);
  return open_text_volume(parse_text_header(file, nrrd, request.selection), request);
}

std::unique_ptr<VolumeSource> open_file(VolumeFormat format, const std::string& file,
                                        const VolumeRequest& request) {
  switch (format) {
    case VolumeFormat::nrrd:
    case VolumeFormat::meta_image: return open_with_text_header(format, file, request);
    case VolumeFormat::nifti: return open_nifti(file, request);
    case VolumeFormat::legacy_vtk: return open_legacy_vtk(file, request);
    case VolumeFormat::tiff: return open_tiff_if_built(file, {file}, request);
    case VolumeFormat::vdb: return open_vdb_if_built(file, request);
    case VolumeFormat::dicom: return open_dicom_if_built(file, {file}, request);
    default: return open_raw(file, request);
  }
}

/// As the file describes it.
std::unique_ptr<VolumeSource> open_whole(const std::string& path, const VolumeRequest& request) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(path, ignored);
  if (path == "-" || folder) {
    refuse_grid(path, request);
    return folder ? open_folder(path, request) : open_stdin(request);
  }
  const auto [file, inner] = split_volume_path(path);
  // Raw samples may begin with anything: a complete description is believed.
  if (request.extent && request.type && format_of_extension(path) == VolumeFormat::raw) {
    refuse_grid(path, request);
    return open_raw(path, request);
  }
  if (const std::string header = nifti_header_beside(path); !header.empty()) {
    refuse_grid(path, request);
    return open_nifti(header, request);
  }
  const VolumeFormat format = recognise_format(file);
  if (format == VolumeFormat::nanovdb)
    throw UsageError(fmt::format(
        "'{}' is a NanoVDB file, which cannot be read: make an OpenVDB file of it (nanovdb_convert "
        "IN.nvdb OUT.vdb) and convert that",
        file));
  if (format == VolumeFormat::zip)
    throw UsageError(fmt::format(
        "'{}' is a zip, of which only a store is read (as a store, not as a file): unpack it",
        file));
  if (format != VolumeFormat::vdb) refuse_grid(file, request);
  if (format == VolumeFormat::vti) return open_vti_if_built(file, inner, request);
  if (format == VolumeFormat::hdf5) return open_hdf5_if_built(file, inner, request);
  if (!inner.empty())
    throw UsageError(fmt::format("'{}' holds no arrays with names: leave ':/{}' out", file, inner));
  return open_file(format, file, request);
}

}  // namespace

std::unique_ptr<VolumeSource> open_source(const std::string& path, const VolumeRequest& request) {
  return select_samples(open_whole(path, request), request);
}

}  // namespace isobrick

#include "io/volumes/open/volume_format.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/file.h"
#include "io/bytes/file_stream.h"
#include "io/bytes/inflate_stream.h"
#include "io/bytes/url.h"
#include "io/bytes/zip_signature.h"
#include "io/volumes/raw/nifti_header.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kHeadBytes = 4096;

std::string read_head(const std::string& path) { return open_input(path).text_at(0, kHeadBytes); }

/// A MetaImage begins with one of the keys that its writers put first.
bool is_meta_image(std::string_view head) {
  const std::size_t equals = head.find('=');
  if (equals == std::string_view::npos || equals > 64) return false;
  const std::string key = lower(trim(head.substr(0, equals)));
  return key == "objecttype" || key == "ndims" || key == "comment";
}

std::span<const std::byte> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

/// The beginning of what a compressed file unpacks to; empty when it is damaged.
std::string unpack_head(const std::string& path) {
  auto packed = make_file_stream(open_input(path));
  std::string head(kHeadBytes, '\0');
  try {
    const auto stream = make_inflate_stream(std::move(packed), Wrapper::gzip);
    head.resize(stream->read(reinterpret_cast<std::byte*>(head.data()), head.size()));
    return head;
  } catch (const Error&) {
    return {};
  }
}

std::optional<VolumeFormat> by_content(const std::string& path, std::string_view head) {
  if (head.starts_with("NRRD000")) return VolumeFormat::nrrd;
  if (is_meta_image(head)) return VolumeFormat::meta_image;
  if (is_nifti(bytes_of(head))) return VolumeFormat::nifti;
  if (head.starts_with("\x1f\x8b") && is_nifti(bytes_of(unpack_head(path))))
    return VolumeFormat::nifti;
  using namespace std::string_view_literals;
  for (const auto magic : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv})
    if (head.starts_with(magic)) return VolumeFormat::tiff;
  // An HDF5 file may begin with something of its user's.
  for (const std::size_t at : {0u, 512u, 1024u, 2048u})
    if (head.size() > at && head.substr(at).starts_with("\x89HDF\r\n\x1a\n"))
      return VolumeFormat::hdf5;
  if (head.size() >= 132 && head.substr(128, 4) == "DICM") return VolumeFormat::dicom;
  if (head.starts_with(" BDV\0\0\0\0"sv)) return VolumeFormat::vdb;
  if (head.starts_with("NanoVDB")) return VolumeFormat::nanovdb;
  if (is_zip_head(head)) return VolumeFormat::zip;
  if (head.starts_with("# vtk DataFile")) return VolumeFormat::legacy_vtk;
  if (head.starts_with("<") && head.substr(0, 1024).find("<VTKFile") != std::string_view::npos)
    return VolumeFormat::vti;
  return std::nullopt;
}

}  // namespace

VolumeFormat format_of_extension(const std::string& path) {
  constexpr std::pair<std::string_view, VolumeFormat> extensions[] = {
      {".nhdr", VolumeFormat::nrrd},      {".nrrd", VolumeFormat::nrrd},
      {".mhd", VolumeFormat::meta_image}, {".mha", VolumeFormat::meta_image},
      {".nii", VolumeFormat::nifti},      {".hdr", VolumeFormat::nifti},
      {".vti", VolumeFormat::vti},        {".vtk", VolumeFormat::legacy_vtk},
      {".tif", VolumeFormat::tiff},       {".tiff", VolumeFormat::tiff},
      {".h5", VolumeFormat::hdf5},        {".hdf5", VolumeFormat::hdf5},
      {".dcm", VolumeFormat::dicom},      {".vdb", VolumeFormat::vdb},
      {".nvdb", VolumeFormat::nanovdb},   {".zip", VolumeFormat::zip},
  };
  if (lower(path).ends_with(".nii.gz")) return VolumeFormat::nifti;
  const std::string extension = lower(std::filesystem::path(path).extension().string());
  for (const auto& [known, format] : extensions)
    if (extension == known) return format;
  return VolumeFormat::raw;
}

std::string_view name_of(VolumeFormat format) {
  constexpr std::array<std::string_view, 12> names{"raw",     "NRRD",       "MetaImage", "NIfTI",
                                                   "VTK XML", "legacy VTK", "TIFF",      "HDF5",
                                                   "DICOM",   "OpenVDB",    "NanoVDB",   "zip"};
  return names[static_cast<std::size_t>(format)];
}

VolumeFormat recognise_format(const std::string& path) {
  const std::string head = read_head(path);
  return by_content(path, head).value_or(format_of_extension(path));
}

VolumePath split_volume_path(const std::string& path) {
  if (is_url(path)) return {path, {}};
  const std::size_t colon = path.rfind(":/");
  std::error_code ignored;
  if (colon == std::string::npos || colon == 0 || std::filesystem::exists(path, ignored))
    return {path, {}};
  return {path.substr(0, colon), path.substr(colon + 2)};
}

std::string volume_stem(const std::string& path) {
  std::string name = split_volume_path(path).file;
  if (is_url(name)) name.erase(std::min(name.find_first_of("?#"), name.size()));
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  std::error_code none;
  std::filesystem::path file = std::filesystem::path(name).filename();
  if (file == "." || file == ".." || file.empty())
    file = std::filesystem::weakly_canonical(name, none).filename();
  for (const char* outer : {".gz", ".zip"})
    if (lower(file.extension().string()) == outer) file = file.stem();
  const std::string stem = file.stem().string();
  return stem.empty() ? "volume" : stem;
}

}  // namespace isobrick

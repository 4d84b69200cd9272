#include "tools/output_name.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>
#include "io/bytes/output_file.h"
#include "io/bytes/url.h"
#include "io/volumes/open/volume_format.h"
#include "tools/format.h"

namespace isobrick::tools {
namespace {

/// Extensions by which people and programs know a format of volumes, meshes or pictures.
constexpr std::string_view kKnown[] = {
    ".raw",  ".bin", ".nrrd", ".nhdr", ".vdb",          ".mha",     ".mhd",  ".nii",
    ".gz",   ".img", ".hdr",  ".h5",   ".hdf",          ".hdf5",    ".nc",   ".tif",
    ".tiff", ".dcm", ".vti",  ".vtk",  ".npy",          ".npz",     ".zarr", ".n5",
    ".ply",  ".stl", ".obj",  ".glb",  ".gltf",         ".vtp",     ".vtu",  ".off",
    ".pvtp", ".png", ".jpg",  ".jpeg", ".bmp",          ".gif",     ".webp", ".exr",
    ".json", ".txt", ".csv",  ".zip",  ".neuroglancer", ".3dtiles", ".piece"};

bool is_among(std::string_view extension, std::span<const std::string_view> extensions) {
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

/// Of a folder's name, which may end in slashes.
std::string extension_of_folder(std::string_view path) {
  while (path.size() > 1 && path.back() == '/') path.remove_suffix(1);
  return extension_of(path);
}

/// A name of an array or a grid, without what has a meaning in paths.
std::string as_file_name(std::string name) {
  for (char& c : name)
    if (c == '/' || static_cast<unsigned char>(c) < ' ') c = '_';
  return name;
}

}  // namespace

void refuse_misleading_name(const std::string& path, std::span<const std::string_view> own,
                            std::string_view instead) {
  const std::string extension = extension_of_folder(path);
  if (is_among(extension, kKnown) && !is_among(extension, own))
    throw UsageError(fmt::format("'{}' would not have the format of its name; {}", path, instead));
}

void refuse_url_output(const std::string& path) {
  if (is_url(path)) throw UsageError(fmt::format("'{}': nothing can be written to a URL", path));
}

void check_picture_name(const std::string& path) {
  if (is_standard_output(path)) return;
  const std::string extension = extension_of(path);
  if (!extension.empty() && extension != ".png")
    throw UsageError(
        fmt::format("'{}' is no picture that can be written; PNG is: name it .png", path));
}

void check_store_name(const std::string& path) {
  if (is_standard_output(path))
    throw UsageError(
        "a store is a folder and cannot go to standard output; name it, such as OUT.zarr");
  refuse_url_output(path);
  constexpr std::string_view own[] = {".zarr", ".zip", ".ozx"};
  refuse_misleading_name(
      path, own,
      "a store is a folder of OME-Zarr: name it .zarr, or .zarr.zip ('isobrick export' "
      "writes .nrrd, .vdb and .raw)");
}

void check_can_write(const std::filesystem::path& path, bool force) {
  if (is_standard_output(path.string())) return;
  check_output(path.string(), force);
  std::error_code none;
  const std::filesystem::path folder = path.parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder, none))
    throw Error(
        fmt::format("cannot create '{}': there is no folder '{}'", path.string(), folder.string()));
}

std::string stem_of_input(const std::string& path, const VolumeRequest& request) {
  if (path == "-") throw UsageError("standard input has no name; name the output with -o");
  std::string stem = volume_stem(path);
  if (const std::string inner = split_volume_path(path).inner; !inner.empty())
    stem += "_" + as_file_name(inner);
  if (request.grid) stem += "_" + as_file_name(*request.grid);
  if (request.selection.channel) stem += fmt::format("_c{}", *request.selection.channel);
  if (request.selection.time) stem += fmt::format("_t{}", *request.selection.time);
  return stem;
}

}  // namespace isobrick::tools

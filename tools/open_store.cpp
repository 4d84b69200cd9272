#include "tools/open_store.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/storage/open_storage.h"
#include "bricks/zarr/metadata_files.h"
#include "core/shell_word.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/url.h"
#include "io/meshes/mesh_name.h"
#include "io/volumes/open/volume_format.h"
#include "io/volumes/raw/raw_name.h"
#include "pipeline/convert/convert_staging.h"
#include "tools/format.h"
#include "tools/mesh_output.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& path, const std::string& what,
                         const std::string& command, const char* wanted = "store") {
  throw Error(fmt::format("'{}' is no {}: {}; {}", path, wanted, what, command));
}

/// The command that makes a store of a volume.
std::string convert_command(const fs::path& volume, const std::string& options = "") {
  fs::path store = volume;
  return fmt::format("run: isobrick convert {} {}{}", shell_word(volume.string()),
                     shell_word(store.replace_extension(".zarr").string()), options);
}

[[noreturn]] void refuse_missing(const std::string& path) {
  if (fs::exists(staging_path(path)))
    refuse(path, fmt::format("its conversion was interrupted ('{}')", staging_path(path).string()),
           fmt::format("run: isobrick convert VOLUME {} --resume", shell_word(path)));
  refuse(path, "nothing has that name",
         fmt::format("make one: isobrick convert VOLUME {}", shell_word(path)));
}

/// Options for samples that the name does not describe.
std::string raw_options(const fs::path& path) {
  const RawName name = parse_raw_name(path.stem().string());
  return name.extent && name.type ? "" : " --dims X,Y,Z --type TYPE";
}

/// Of the formats of pictures that are no slices of volumes.
bool has_picture_name(const fs::path& path) {
  constexpr std::array<std::string_view, 6> extensions{".png", ".jpg",  ".jpeg",
                                                       ".gif", ".webp", ".bmp"};
  return std::find(extensions.begin(), extensions.end(), extension_of(path)) != extensions.end();
}

/// Refuses files that no command reads samples from.
void refuse_meshes_and_pictures(const fs::path& path, const char* wanted) {
  const std::string name = path.string();
  if (has_mesh_name(path)) {
    fs::path picture = path;
    refuse(name, "it is a mesh",
           fmt::format("run: isobrick render {} -o {}", shell_word(name),
                       shell_word(picture.replace_extension(".png").string())),
           wanted);
  }
  if (has_picture_name(path))
    refuse(name, "it is a picture", "name the store or the volume that it shows", wanted);
}

[[noreturn]] void refuse_file(const fs::path& path) {
  const std::string name = path.string();
  refuse_meshes_and_pictures(path, "store");
  const VolumeFormat format = recognise_format(name);
  refuse(name, fmt::format("it is a volume of the format {}", name_of(format)),
         convert_command(path, format == VolumeFormat::raw ? raw_options(path) : ""));
}

/// Refuses a folder in which Zarr lies.
void refuse_outer_folder(const fs::path& path, const char* wanted) {
  for (const FolderEntry& entry : folder_entries(path)) {
    const fs::path inner = path / entry.name;
    std::error_code ignored;
    if (fs::is_directory(inner, ignored) && is_zarr(inner))
      refuse(path.string(), "it is a folder that holds Zarr",
             fmt::format("name that, such as {}", shell_word(inner.string())), wanted);
  }
}

[[noreturn]] void refuse_folder(const fs::path& path) {
  refuse_outer_folder(path, "store");
  refuse(path.string(), "it is a folder without Zarr's metadata",
         "if it holds the slices of a volume, " + convert_command(path));
}

}  // namespace

void check_store(const std::string& path) {
  if (is_url(path)) return;
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (is_zarr(path)) return;
  if (!fs::exists(status)) refuse_missing(path);
  if (fs::is_regular_file(status)) refuse_file(path);
  if (fs::is_directory(status)) refuse_folder(path);
}

void refuse_folder_of_zarr(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored) && !is_zarr(path)) refuse_outer_folder(path, "volume");
}

void check_input(const std::string& path) {
  if (is_url(path)) return;
  const std::string file = path == "-" ? path : split_volume_path(path).file;
  std::error_code ignored;
  const fs::file_status status = fs::status(file, ignored);
  if (path == "-") return;
  if (find_folder_in_zip(file)) return;
  const bool store_name = extension_of(file) == ".zarr";
  if (!fs::exists(status)) {
    if (store_name || fs::exists(staging_path(path))) refuse_missing(path);
    throw Error(fmt::format("'{}' does not exist", path));
  }
  if (store_name && fs::is_regular_file(status) && !is_zarr(file)) refuse_file(file);
  if (fs::is_regular_file(status)) refuse_meshes_and_pictures(file, "volume");
}

StoreReader open_store(const std::string& path, const Selection& selection) {
  check_store(path);
  return StoreReader(path, selection);
}

}  // namespace isobrick::tools

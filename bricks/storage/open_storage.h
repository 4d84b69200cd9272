#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace isobrick::inline v0 {

/// A folder in a zip, such as the image that "scan.zarr.zip/labels/cells" names.
struct FolderInZip {
  std::filesystem::path zip;
  std::string folder;  ///< as the beginning of keys has it, without a slash at its end
};

/// What a path through a zip names, be it there or not; nullopt for a path that leads to no zip.
std::optional<FolderInZip> find_folder_in_zip(const std::filesystem::path& path);

/// Whether a file is a zip, by its content or else by its name, or a path leads into one.
bool is_zip(const std::filesystem::path& path);

}  // namespace isobrick

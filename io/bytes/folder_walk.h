#pragma once

#include <dirent.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace isobrick::inline v0 {

// The standard library's iterators over folders end the program where memory is short.

struct FolderDeleter {
  void operator()(DIR* folder) const { ::closedir(folder); }
};

struct FolderEntry {
  std::string name;
  std::filesystem::file_type type;  ///< of a link that it is one
};

/// Whether something has that name, if only a link that leads nowhere.
bool is_there(const std::filesystem::path& path);

/// The path without the slashes that it may end in.
std::filesystem::path without_slash(const std::filesystem::path& path);

/// What a folder holds, in no particular order. Throws Error where it cannot be read.
std::vector<FolderEntry> folder_entries(const std::filesystem::path& folder);

/// Calls visit(path relative to `root`, type) for everything below a folder, a folder before what
/// is in it, until it returns false. Follows no links. Throws Error where a folder cannot be read.
void walk_folder(
    const std::filesystem::path& root,
    const std::function<bool(const std::filesystem::path&, std::filesystem::file_type)>& visit);

}  // namespace isobrick

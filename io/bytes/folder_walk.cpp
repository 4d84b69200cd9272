#include "io/bytes/folder_walk.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <memory>
#include <string_view>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

fs::file_type type_of(mode_t mode) {
  switch (mode & S_IFMT) {
    case S_IFREG: return fs::file_type::regular;
    case S_IFDIR: return fs::file_type::directory;
    case S_IFLNK: return fs::file_type::symlink;
    default: return fs::file_type::unknown;
  }
}

/// Throws for what is wrong; an entry that has gone meanwhile has the type not_found.
fs::file_type type_of(DIR* folder, const dirent& entry, const fs::path& path) {
  if (entry.d_type != DT_UNKNOWN) return type_of(static_cast<mode_t>(DTTOIF(entry.d_type)));
  struct stat status {};
  if (::fstatat(::dirfd(folder), entry.d_name, &status, AT_SYMLINK_NOFOLLOW) == 0)
    return type_of(status.st_mode);
  if (errno == ENOENT) return fs::file_type::not_found;
  throw system_error("look at", (path / entry.d_name).string(), errno);
}

}  // namespace

bool is_there(const std::filesystem::path& path) {
  return std::filesystem::symlink_status(path).type() != std::filesystem::file_type::not_found;
}

std::filesystem::path without_slash(const std::filesystem::path& path) {
  return path.has_filename() || !path.has_relative_path() ? path : path.parent_path();
}

std::vector<FolderEntry> folder_entries(const fs::path& path) {
  const std::unique_ptr<DIR, FolderDeleter> folder(::opendir(path.c_str()));
  if (!folder) throw system_error("look into the folder", path.string(), errno);
  std::vector<FolderEntry> entries;
  for (;;) {
    errno = 0;
    const dirent* const entry = ::readdir(folder.get());
    if (!entry && errno != 0) throw system_error("look into the folder", path.string(), errno);
    if (!entry) return entries;
    const std::string_view name = entry->d_name;
    if (name == "." || name == "..") continue;
    const fs::file_type type = type_of(folder.get(), *entry, path);
    if (type != fs::file_type::not_found) entries.push_back({std::string(name), type});
  }
}

void walk_folder(const fs::path& root,
                 const std::function<bool(const fs::path&, fs::file_type)>& visit) {
  std::vector<fs::path> folders{fs::path()};
  while (!folders.empty()) {
    const fs::path folder = std::move(folders.back());
    folders.pop_back();
    for (const FolderEntry& entry : folder_entries(root / folder)) {
      fs::path path = folder / entry.name;
      if (!visit(path, entry.type)) return;
      if (entry.type == fs::file_type::directory) folders.push_back(std::move(path));
    }
  }
}

}  // namespace isobrick

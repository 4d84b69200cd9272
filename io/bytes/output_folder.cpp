#include "io/bytes/output_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/exchange.h"
#include "io/bytes/folder_walk.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr int kFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;

/// Throws what is wrong with `name` in `folder`; `path` is for the message.
[[noreturn]] void fail(const char* what, int folder, const std::string& name, const fs::path& path,
                       int errno_value) {
  struct stat status {};
  if (::fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 && S_ISLNK(status.st_mode))
    throw Error(
        fmt::format("'{}' is a symbolic link, and nothing is written through a link in a store; "
                    "put what it means in its place",
                    path.string()));
  throw system_error(what, path.string(), errno_value);
}

/// The components of `path` below `root`. What is below "." may be named without it.
std::vector<std::string> names_below(const fs::path& root, const fs::path& path) {
  const bool named = root != "." || (path.begin() != path.end() && *path.begin() == ".");
  const auto [r, p] =
      std::mismatch(named ? root.begin() : root.end(), root.end(), path.begin(), path.end());
  if (r != root.end())
    throw Error(fmt::format("'{}' is not in '{}'", path.string(), root.string()));
  std::vector<std::string> names;
  for (auto name = p; name != path.end(); ++name) {
    if (name->empty() || *name == ".") continue;
    if (*name == "..") throw Error(fmt::format("'{}' leads out of a folder", path.string()));
    names.push_back(name->string());
  }
  return names;
}

UniqueFd open_below(int folder, const std::string& name, bool make) {
  UniqueFd fd(::openat(folder, name.c_str(), kFolder));
  if (fd.get() >= 0 || errno != ENOENT || !make) return fd;
  if (::mkdirat(folder, name.c_str(), 0777) != 0 && errno != EEXIST) return UniqueFd();
  return UniqueFd(::openat(folder, name.c_str(), kFolder));
}

/// Removes all that `fd` holds; 0, or the errno of what failed.
int remove_entries(UniqueFd fd) {
  UniqueFd copy = duplicate(fd.get());
  const std::unique_ptr<DIR, FolderDeleter> folder(copy.get() < 0 ? nullptr
                                                                  : ::fdopendir(copy.get()));
  if (!folder) return errno;
  copy.release();  // closedir() closes it
  std::vector<std::string> names;
  while (const dirent* entry = ::readdir(folder.get()))
    if (const std::string name = entry->d_name; name != "." && name != "..") names.push_back(name);
  for (const std::string& name : names) {
    if (::unlinkat(fd.get(), name.c_str(), 0) == 0 || errno == ENOENT) continue;
    if (errno != EISDIR && errno != EPERM) return errno;
    UniqueFd below(::openat(fd.get(), name.c_str(), kFolder));
    if (below.get() < 0) return errno;
    if (const int failure = remove_entries(std::move(below)); failure != 0) return failure;
    if (::unlinkat(fd.get(), name.c_str(), AT_REMOVEDIR) != 0 && errno != ENOENT) return errno;
  }
  return 0;
}

}  // namespace

/// Something in an open folder; without a name it is the folder itself.
struct OutputFolder::Place {
  UniqueFd folder;  ///< negative: there is no such folder
  std::string name;
};

OutputFolder::OutputFolder(const fs::path& root)
    : root_(without_slash(root)), fd_(::open(root_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (fd_.get() < 0) throw system_error("open the folder", root_.string(), errno);
}

OutputFolder::Place OutputFolder::find(const fs::path& path, bool make_folders) const {
  const std::vector<std::string> names = names_below(root_, path);
  Place place{duplicate(fd_.get()), ""};
  if (place.folder.get() < 0) throw system_error("open", root_.string(), errno);
  fs::path above = root_;
  for (std::size_t i = 0; i + 1 < names.size(); ++i) {
    above /= names[i];
    UniqueFd next = open_below(place.folder.get(), names[i], make_folders);
    if (next.get() < 0 && errno == ENOENT && !make_folders) return {};
    if (next.get() < 0)
      fail(make_folders ? "create" : "open", place.folder.get(), names[i], above, errno);
    place.folder = std::move(next);
  }
  if (!names.empty()) place.name = names.back();
  return place;
}

File OutputFolder::create_file(const fs::path& path) const {
  const Place place = find(path, true);
  for (int attempt = 0;; ++attempt) {
    // O_EXCL follows no link, and no hard link either.
    UniqueFd fd(::openat(place.folder.get(), place.name.c_str(),
                         O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (fd.get() >= 0) return {std::move(fd), path};
    if (errno != EEXIST || attempt == 100) throw system_error("create", path.string(), errno);
    if (::unlinkat(place.folder.get(), place.name.c_str(), 0) != 0 && errno != ENOENT)
      throw system_error("replace", path.string(), errno);
  }
}

File OutputFolder::open_file(const fs::path& path, int access) const {
  const Place place = find(path, false);
  if (place.folder.get() < 0) return {};
  // Without O_NONBLOCK a FIFO here would wait for somebody at its other end.
  UniqueFd fd(::openat(place.folder.get(), place.name.c_str(),
                       access | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (fd.get() < 0 && errno == ENOENT) return {};
  if (fd.get() < 0) fail("open", place.folder.get(), place.name, path, errno);
  return require_regular({std::move(fd), path});
}

UniqueFd OutputFolder::make_folder(const fs::path& path) const {
  Place place = find(path, true);
  if (place.name.empty()) return std::move(place.folder);
  UniqueFd fd = open_below(place.folder.get(), place.name, true);
  if (fd.get() < 0) fail("create", place.folder.get(), place.name, path, errno);
  return fd;
}

void OutputFolder::rename_file(const fs::path& from, const fs::path& to) const {
  const Place source = find(from, false), target = find(to, false);
  if (::renameat(source.folder.get(), source.name.c_str(), target.folder.get(),
                 target.name.c_str()) != 0)
    throw system_error("rename a finished file to", to.string(), errno);
}

void OutputFolder::remove_file(const fs::path& path) const {
  const Place place = find(path, false);
  if (place.folder.get() < 0) return;
  if (::unlinkat(place.folder.get(), place.name.c_str(), 0) != 0 && errno != ENOENT)
    throw system_error("remove", path.string(), errno);
}

void OutputFolder::remove_folder(const fs::path& path) const {
  const Place place = find(path, false);
  if (place.folder.get() < 0) return;
  UniqueFd fd(::openat(place.folder.get(), place.name.c_str(), kFolder));
  if (fd.get() < 0 && errno == ENOENT) return;
  if (fd.get() < 0 && (errno == ENOTDIR || errno == ELOOP)) return remove_file(path);
  if (fd.get() < 0) throw system_error("remove", path.string(), errno);
  int failure = remove_entries(std::move(fd));
  if (failure == 0 && ::unlinkat(place.folder.get(), place.name.c_str(), AT_REMOVEDIR) != 0 &&
      errno != ENOENT)
    failure = errno;
  if (failure != 0) throw system_error("remove", path.string(), failure);
}

void OutputFolder::replace_folder(const fs::path& finished, const fs::path& place) const {
  const Place from = find(finished, false), to = find(place, true);
  const int parent = to.folder.get();
  struct stat status {};
  if (::fstatat(parent, to.name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0) {
    exchange(parent, from.name, to.name);
    sync_folder(place.parent_path());
    remove_folder(finished);
  } else if (::renameat(from.folder.get(), from.name.c_str(), parent, to.name.c_str()) != 0) {
    throw system_error(fmt::format("rename '{}' to", finished.string()), place.string(), errno);
  }
  sync_folder(place.parent_path());
}

void OutputFolder::sync_folder(const fs::path& path) const {
  const Place place = find(path, false);
  UniqueFd below;
  int fd = place.folder.get();
  if (fd >= 0 && !place.name.empty()) {
    below = UniqueFd(::openat(fd, place.name.c_str(), kFolder));
    fd = below.get();
  }
  // Entries may be made in a folder that one may not read; others sync it then.
  if (fd < 0 && errno == EACCES) return;
  if (fd < 0) throw system_error("open", path.string(), errno);
  // Some file systems cannot sync a folder and return EINVAL; there is nothing more to do then.
  if (::fsync(fd) != 0 && errno != EINVAL) throw system_error("sync", path.string(), errno);
}

}  // namespace isobrick

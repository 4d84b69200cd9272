#include "io/bytes/leftovers.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <new>
#include <vector>

#include <isobrick/error.h>
#include "core/cancel.h"
#include "core/digits.h"
#include "io/bytes/folder_walk.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// What a temporary name of an output ends with: ".partial-4711-0-5a9c01ef", process, counter and
/// FNV-1a of all before, so that nobody else's file has such a name.
std::string temporary_suffix(std::string_view output, std::string_view process_and_counter) {
  std::string suffix = fmt::format(".partial-{}", process_and_counter);
  std::uint32_t hash = 2166136261U;
  for (const std::string_view text : {output, std::string_view(suffix)})
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return suffix + fmt::format("-{:08x}", hash);
}

std::recursive_timed_mutex& publication_mutex() {
  static auto* const mutex = new std::recursive_timed_mutex;  // as taken_names()
  return *mutex;
}

/// The temporary names that this process took; no other process has the same. What they named may
/// be published or removed since.
struct TakenNames {
  std::mutex mutex;
  std::vector<std::string> names;
};

TakenNames& taken_names() {
  static TakenNames* const instance = new TakenNames;  // threads may outlive main()
  return *instance;
}

void note_taken(const std::string& name) {
  TakenNames& taken = taken_names();
  const std::lock_guard lock(taken.mutex);
  // Those of earlier outputs, so that the list stays short in a process that lives long.
  std::erase_if(taken.names, [](const std::string& earlier) {
    std::error_code failure;
    return fs::symlink_status(earlier, failure).type() == fs::file_type::not_found;
  });
  taken.names.push_back(name);
}

/// Whether this process took the name.
bool is_taken(const fs::path& path) {
  TakenNames& taken = taken_names();
  const std::lock_guard lock(taken.mutex);
  return std::find(taken.names.begin(), taken.names.end(), path.string()) != taken.names.end();
}

/// Locks what was just created; false when somebody took it for a leftover in between. Where a
/// file system has no locks nobody can take it.
bool keep(const UniqueFd& fd) {
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return false;
  struct stat status {};
  return ::fstat(fd.get(), &status) == 0 && status.st_nlink > 0;
}

/// Calls create(name) → errno-setting descriptor until a name is free.
template <class Create>
Temporary create_beside(const std::string& path, const Create& create) {
  static std::atomic<unsigned> counter{0};
  for (int attempt = 0;; ++attempt) {
    std::string name = path + temporary_suffix(fs::path(path).filename().string(),
                                               fmt::format("{}-{}", ::getpid(), counter++));
    UniqueFd fd(create(name.c_str()));
    if (fd.get() >= 0 && keep(fd)) {
      note_taken(name);
      return {std::move(fd), std::move(name)};
    }
    if ((fd.get() < 0 && errno != EEXIST) || attempt == 100)
      throw system_error("create", path, errno);
  }
}

bool only_parts(const fs::path& folder) {
  const std::vector<FolderEntry> entries = folder_entries(folder);
  return std::ranges::all_of(entries,
                             [](const FolderEntry& entry) { return is_part_name(entry.name); });
}

/// Removes a file or folder that nobody holds; whether it did.
bool remove_if_left(const fs::path& path, bool whole_folders) {
  const bool folder = fs::is_directory(fs::symlink_status(path));
  const int flags = folder ? O_RDONLY | O_DIRECTORY : O_RDWR | O_NONBLOCK;
  const UniqueFd fd(::open(path.c_str(), flags | O_NOFOLLOW | O_CLOEXEC));
  struct stat status {};
  if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0) return false;
  if (!folder && !S_ISREG(status.st_mode)) return false;
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) return false;
  std::error_code failure;
  if (!folder) return fs::remove(path, failure);
  return (whole_folders || only_parts(path)) && fs::remove_all(path, failure) > 0 && !failure;
}

}  // namespace

fs::path temporary_folder() {
  std::error_code failure;
  fs::path folder = fs::temp_directory_path(failure);
  if (failure)
    throw Error("there is no folder for temporary files; set TMPDIR to one: " + failure.message());
  return folder;
}

Temporary create_temporary_file(const std::string& path) {
  // O_EXCL: never through a link that somebody else put there.
  return create_beside(path, [](const char* name) {
    return ::open(name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  });
}

Temporary create_temporary_folder(const std::string& path) {
  return create_beside(path, [](const char* name) {
    if (::mkdir(name, 0777) != 0) return -1;
    return ::open(name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  });
}

bool remove_leftovers(const std::string& path, bool whole_folders) {
  const fs::path output(path);
  const fs::path folder = output.has_parent_path() ? output.parent_path() : fs::path(".");
  // In a folder of this process nothing is left of others, and there may be many files to list.
  if (is_taken(folder)) return false;
  const std::string name = output.filename().string();
  bool any = false;
  try {
    for (const FolderEntry& entry : folder_entries(folder))
      if (is_temporary_of(entry.name, name))
        any |= remove_if_left(folder / entry.name, whole_folders);
  } catch (const Error&) {
    // One may write into a folder that one may not list.
  }
  return any;
}

bool is_temporary_of(std::string_view name, std::string_view output) {
  constexpr std::string_view partial = ".partial-";
  if (!name.starts_with(output) || !name.substr(output.size()).starts_with(partial)) return false;
  const std::string_view suffix = name.substr(output.size());
  const std::string_view numbers = suffix.substr(
      partial.size(), suffix.rfind('-') - std::min(partial.size(), suffix.rfind('-')));
  const std::size_t dash = numbers.find('-');
  return dash != std::string_view::npos && is_digits(numbers.substr(0, dash)) &&
         is_digits(numbers.substr(dash + 1)) && temporary_suffix(output, numbers) == suffix;
}

Publication::Publication() {
  publication_mutex().lock();
  if (!cancel_requested()) return;
  publication_mutex().unlock();
  throw Cancelled("interrupted");
}

Publication::~Publication() { publication_mutex().unlock(); }

void remove_unfinished() noexcept {
  // Not unlocked: nothing is published any more. A rename that hangs is not waited for.
  if (!publication_mutex().try_lock_for(std::chrono::milliseconds(200))) return;
  TakenNames& taken = taken_names();
  const std::lock_guard lock(taken.mutex);
  for (const std::string& name : taken.names) try {
      std::error_code ignored;
      fs::remove_all(name, ignored);
    } catch (const std::bad_alloc&) {
      // The next run of the same output removes it.
    }
}

std::string part_name(std::uint64_t number, std::uint32_t cut, std::string_view extension) {
  return cut == 0 ? fmt::format("part_{}{}", number, extension)
                  : fmt::format("part_{}_{}{}", number, cut, extension);
}

bool is_part_name(std::string_view name) {
  constexpr std::string_view prefix = "part_";
  const std::size_t dot = name.find('.');
  if (!name.starts_with(prefix) || dot == std::string_view::npos) return false;
  const std::string_view numbers = name.substr(prefix.size(), dot - prefix.size());
  const std::size_t between = numbers.find('_');
  return is_digits(numbers.substr(0, between)) &&
         (between == std::string_view::npos || is_digits(numbers.substr(between + 1)));
}

}  // namespace isobrick

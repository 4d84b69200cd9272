#include "isobrick/io/parted_output.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>

#include "isobrick/core/error.h"
#include "isobrick/io/exchange.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

bool is_part_name(std::string_view name) {
  constexpr std::string_view prefix = "part_";
  if (!name.starts_with(prefix)) return false;
  const std::size_t dot = name.find('.');
  const std::string_view number = name.substr(prefix.size(), dot - prefix.size());
  return dot != std::string_view::npos && !number.empty() &&
         std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Whether something is at the folder's place; throws when it must stay there.
bool check_folder(const fs::path& folder, bool force) {
  const fs::file_status status = fs::symlink_status(folder);
  if (status.type() == fs::file_type::not_found) return false;
  if (!force)
    throw UsageError(
        fmt::format("'{}' exists already; say --force to replace it", folder.string()));
  if (status.type() != fs::file_type::directory)
    throw UsageError(fmt::format("'{}' is no folder of parts", folder.string()));
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.symlink_status().type() != fs::file_type::regular ||
        !is_part_name(entry.path().filename().native()))
      throw UsageError(fmt::format("'{}' holds '{}', which is no part of a mesh; move it away",
                                   folder.string(), entry.path().filename().string()));
  return true;
}

fs::path create_folder_beside(const fs::path& folder) {
  static std::atomic<unsigned> counter{0};
  for (int attempt = 0;; ++attempt) {
    const fs::path name = fmt::format("{}.partial-{}-{}", folder.string(), ::getpid(), counter++);
    std::error_code failure;
    if (fs::create_directory(name, failure)) return name;
    if (failure) throw system_error("create", name.string(), failure.value());
    if (attempt == 100) throw system_error("create", name.string(), EEXIST);
  }
}

/// Moves `from` to `to`, where nothing may be.
void move_to_free_place(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return;
  // The file system may not know the flag.
  const bool plain = errno == EINVAL || errno == ENOSYS;
  if (plain && ::rename(from.c_str(), to.c_str()) == 0) return;
  throw system_error("rename the finished folder to", to.string(), errno);
}

/// Moves `from` to `to`; when that exists the two change places.
void move_folder(const fs::path& from, const fs::path& to, bool exists) {
  exists ? exchange(from, to) : move_to_free_place(from, to);
}

}  // namespace

PartedOutput::PartedOutput(std::string path, bool force)
    : folder_(path + ".parts"),
      replaces_(check_folder(folder_, force)),
      index_(std::move(path), force) {}

PartedOutput::~PartedOutput() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

FileWriter PartedOutput::create_part(std::string_view extension) {
  if (temporary_.empty()) temporary_ = create_folder_beside(folder_);
  const fs::path path = temporary_ / fmt::format("part_{}{}", parts_, extension);
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error("create", path.string(), errno);
  ++parts_;
  return FileWriter(std::move(fd), (folder_ / path.filename()).string());
}

std::string PartedOutput::reference(std::size_t part, std::string_view extension) const {
  return fmt::format("{}/part_{}{}", folder_.filename().string(), part, extension);
}

void PartedOutput::publish() {
  if (parts_ == 0) {
    index_.publish();
    if (replaces_) fs::remove_all(folder_);
    return;
  }
  move_folder(temporary_, folder_, replaces_);
  try {
    index_.publish();
  } catch (...) {
    move_folder(replaces_ ? temporary_ : folder_, replaces_ ? folder_ : temporary_, replaces_);
    throw;
  }
  if (!replaces_) temporary_.clear();  // else the one that was replaced; the destructor removes it
}

}  // namespace isobrick

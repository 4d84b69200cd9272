#include "bricks/storage/range_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/text_hash.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStateFile = "state.json";
constexpr const char* kTotalFile = "total";
constexpr const char* kTemporary = "partial-";
/// A temporary file of this age was left by a process that was killed.
constexpr double kAbandonedMs = 600e3;

/// Bytes that a file takes on the disk.
std::uint64_t disk_bytes(std::uint64_t size) {
  constexpr std::uint64_t block = 4096;
  return (size + block - 1) / block * block;
}

/// Holds the lock of an open file, which ends with the process, too.
class FileLock {
 public:
  explicit FileLock(int fd) : fd_(fd) {
    while (::flock(fd_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~FileLock() { ::flock(fd_, LOCK_UN); }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int fd_;
};

/// The number in a file; nullopt where there is none.
std::optional<std::uint64_t> read_total(int fd) {
  std::uint64_t total = 0;
  if (::pread(fd, &total, sizeof total, 0) != sizeof total) return std::nullopt;
  return total;
}

void write_total(int fd, std::uint64_t total) {
  // Where it fails, the next process counts the files.
  if (::pwrite(fd, &total, sizeof total, 0) != sizeof total && ::ftruncate(fd, 0) != 0) return;
}

/// Milliseconds since a file was used.
double age_ms(const struct stat& file, const timespec& now) {
  return std::max(0., 1e3 * static_cast<double>(now.tv_sec - file.st_mtim.tv_sec) +
                          1e-6 * static_cast<double>(now.tv_nsec - file.st_mtim.tv_nsec));
}

/// Calls `use` with each file of the cache but the total.
template <class Use>
void for_each_file(const fs::path& folder, Use use) {
  std::error_code failure;
  for (fs::recursive_directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    struct stat file {};
    if (entry.depth() == 0 || ::lstat(entry->path().c_str(), &file) != 0) continue;
    if (S_ISREG(file.st_mode)) use(entry->path(), file);
  }
}

/// Files by their age, in memory that does not depend on their number.
class AgeHistogram {
 public:
  static std::size_t bin(double ms) {
    return std::min(kBins - 1, static_cast<std::size_t>(16 * std::log2(ms + 1)));
  }
  void add(double ms, std::uint64_t bytes) { bytes_[bin(ms)] += bytes; }
  /// Bytes of a bin and of all younger ones.
  std::uint64_t up_to(std::size_t bin) const {
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < kBins && i <= bin; ++i) bytes += bytes_[i];
    return bytes;
  }
  /// The youngest bin that must lose files so that `limit` bytes are left; older ones lose all.
  std::size_t first_to_go(std::uint64_t limit) const {
    std::uint64_t kept = 0;
    for (std::size_t i = 0; i < kBins; ++i)
      if ((kept += bytes_[i]) > limit) return i;
    return kBins;
  }

 private:
  static constexpr std::size_t kBins = 1024;
  std::array<std::uint64_t, kBins> bytes_{};
};

int write_all(int fd, std::initializer_list<std::span<const std::byte>> parts) {
  for (std::span<const std::byte> part : parts)
    while (!part.empty()) {
      const ssize_t count = ::write(fd, part.data(), part.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return count < 0 ? errno : ENOSPC;
      part = part.subspan(static_cast<std::size_t>(count));
    }
  return 0;
}

}  // namespace

std::uint64_t ObjectState::hash() const {
  return text_hash(fmt::format("{}\n{}\n{}", size, etag, last_modified));
}

RangeCache::RangeCache(const fs::path& cache, std::uint64_t limit, Note on_note)
    : folder_(cache / "remote"), limit_(limit), on_note_(std::move(on_note)), is_writable_(true) {
  std::error_code failure;
  fs::create_directories(folder_, failure);
  const fs::path total = folder_ / kTotalFile;
  total_ = UniqueFd(::open(total.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (total_.get() < 0) {
    give_up(folder_.string(), failure ? failure.value() : errno);
    return;
  }
  const FileLock held(total_.get());
  make_room(0);  // the limit may be smaller than that of the last process
}

fs::path RangeCache::folder_of(const std::string& url) const {
  return folder_ / fmt::format("{:016x}", text_hash(url));
}

std::optional<CachedState> RangeCache::find(const fs::path& folder) const {
  std::ifstream file(folder / kStateFile);
  if (!file) return std::nullopt;
  const nlohmann::json object = nlohmann::json::parse(file, nullptr, false);
  try {
    CachedState state{.is_missing = object.at("missing").get<bool>(),
                      .fresh_until = object.at("fresh_until").get<std::int64_t>(),
                      .root = object.at("root").get<std::uint64_t>()};
    if (!state.is_missing)
      state.state = {object.at("size").get<std::uint64_t>(), object.at("etag").get<std::string>(),
                     object.at("last_modified").get<std::string>()};
    return state;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // cut short by a failure of the power
  }
}

void RangeCache::put(const fs::path& folder, const CachedState& state) {
  nlohmann::json object{
      {"missing", state.is_missing}, {"fresh_until", state.fresh_until},
      {"root", state.root},          {"size", state.state.size},
      {"etag", state.state.etag},    {"last_modified", state.state.last_modified}};
  // Headers of servers may be no UTF-8.
  const std::string text =
      object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
  write(folder / kStateFile, {std::as_bytes(std::span(text))});
}

void RangeCache::forget(const fs::path& folder) { remove(folder / kStateFile); }

void RangeCache::note_change(const fs::path& root_folder) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  put(root_folder, {.root = static_cast<std::uint64_t>(now.count())});
}

std::uint64_t RangeCache::last_change(const fs::path& root_folder) const {
  const auto known = find(root_folder);
  return known ? known->root : 0;
}

/// Opens a temporary file that has its size at once, so that whoever counts the files knows of it.
/// No file, and errno, where it cannot be made; errno 0 where there is no room.
UniqueFd RangeCache::open_temporary(const fs::path& file, std::uint64_t size) {
  const std::lock_guard lock(mutex_);
  errno = 0;
  if (!is_writable_ || disk_bytes(size) > limit_) return {};
  const FileLock held(total_.get());
  if (!make_room(disk_bytes(size))) {
    errno = 0;
    return {};
  }
  UniqueFd fd;
  // Another process may remove an empty folder.
  for (int tries = 0; fd.get() < 0 && tries < 3; ++tries) {
    ::mkdir(file.parent_path().c_str(), 0777);
    fd = UniqueFd(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  }
  if (fd.get() < 0 || ::ftruncate(fd.get(), static_cast<off_t>(size)) == 0) return fd;
  const int why = errno;
  ::unlink(file.c_str());
  errno = why;
  return {};
}

bool RangeCache::write(const fs::path& file,
                       std::initializer_list<std::span<const std::byte>> parts) {
  static std::atomic<std::uint64_t> count = 0;
  std::uint64_t size = 0;
  for (const auto part : parts) size += part.size();
  const fs::path temporary =
      file.parent_path() / fmt::format("{}{}-{}", kTemporary, ::getpid(), count++);
  UniqueFd fd = open_temporary(temporary, size);
  if (fd.get() < 0) {
    if (errno != 0) give_up(file.parent_path().string(), errno);
    return false;
  }
  int why = write_all(fd.get(), parts);
  if (::close(fd.release()) != 0 && why == 0) why = errno;
  if (why == 0 && ::rename(temporary.c_str(), file.c_str()) != 0) why = errno;
  if (why == 0) return true;
  ::unlink(temporary.c_str());
  // A folder that was removed meanwhile is no reason to keep nothing more.
  if (why != ENOENT) give_up(file.parent_path().string(), why);
  return false;
}

void RangeCache::remove(const fs::path& file) {
  struct stat status {};
  const std::lock_guard lock(mutex_);
  if (!is_writable_ || ::stat(file.c_str(), &status) != 0 || ::unlink(file.c_str()) != 0) return;
  const FileLock held(total_.get());
  const std::uint64_t bytes = disk_bytes(static_cast<std::uint64_t>(status.st_size));
  if (const auto total = read_total(total_.get()))
    write_total(total_.get(), *total - std::min(*total, bytes));
}

/// Counts `bytes` more, and removes files where that is more than the limit. Whether there is room.
/// The caller holds both locks.
bool RangeCache::make_room(std::uint64_t bytes) {
  std::optional<std::uint64_t> total = read_total(total_.get());
  // More than needed, so that not every file that comes looks at all of them.
  if (!total || *total + bytes > limit_)
    total = shrink(std::min(limit_ - bytes, limit_ - limit_ / 8));
  const bool has_room = *total + bytes <= limit_;
  write_total(total_.get(), *total + (has_room ? bytes : 0));
  return has_room;
}

/// Removes the files that were used longest ago, but none that are being written. Returns the bytes
/// of those that are left.
std::uint64_t RangeCache::shrink(std::uint64_t limit) const {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const auto size_of = [](const struct stat& file) {
    return disk_bytes(static_cast<std::uint64_t>(file.st_size));
  };
  const auto is_temporary = [](const fs::path& path) {
    return path.filename().string().starts_with(kTemporary);
  };
  AgeHistogram ages;
  std::uint64_t being_written = 0;
  for_each_file(folder_, [&](const fs::path& path, const struct stat& file) {
    const double age = age_ms(file, now);
    if (is_temporary(path) && age <= kAbandonedMs)
      being_written += size_of(file);
    else
      ages.add(age, size_of(file));
  });
  limit -= std::min(limit, being_written);
  const std::size_t last = ages.first_to_go(limit);
  std::uint64_t left = ages.up_to(SIZE_MAX), younger = ages.up_to(last);
  for_each_file(folder_, [&](const fs::path& path, const struct stat& file) {
    const double age = age_ms(file, now);
    const std::size_t bin = AgeHistogram::bin(age);
    const bool goes =
        is_temporary(path) ? age > kAbandonedMs : bin > last || (bin == last && younger > limit);
    if (!goes || ::unlink(path.c_str()) != 0) return;
    left -= std::min(left, size_of(file));
    if (bin == last) younger -= std::min(younger, size_of(file));
    ::rmdir(path.parent_path().c_str());  // where it is empty
  });
  return left + being_written;
}

void RangeCache::give_up(const std::string& what, int why) {
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(is_writable_, false)) return;
  }
  if (on_note_)
    on_note_(fmt::format("nothing more is kept of remote stores: cannot write to '{}' ({})", what,
                         std::generic_category().message(why)));
}

}  // namespace isobrick

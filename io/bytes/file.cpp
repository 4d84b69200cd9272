#include "io/bytes/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

struct stat status_of(const File& file) {
  struct stat status {};
  if (::fstat(file.fd(), &status) != 0) throw system_error("examine", file.path().string(), errno);
  return status;
}

void check_offset(const File& file, std::uint64_t offset, std::size_t size) {
  constexpr auto limit = static_cast<std::uint64_t>(std::numeric_limits<off_t>::max());
  if (offset > limit || size > limit - offset)
    throw DamageError(
        fmt::format("'{}': offset {} is out of bounds", file.path().string(), offset));
}

DamageError not_regular(const std::filesystem::path& path) {
  return DamageError(fmt::format("'{}' is not a regular file", path.string()));
}

UniqueFd open_to_read(const std::filesystem::path& path) {
  // Without O_NONBLOCK a FIFO would wait for somebody who writes to it.
  return UniqueFd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
}

}  // namespace

UniqueFd::~UniqueFd() {
  if (fd_ >= 0) ::close(fd_);
}

UniqueFd duplicate(int fd) { return UniqueFd(::fcntl(fd, F_DUPFD_CLOEXEC, 0)); }

File File::share() const {
  UniqueFd fd = duplicate(fd_.get());
  if (fd.get() < 0) throw system_error("open once more", path_.string(), errno);
  return {std::move(fd), path_};
}

std::uint64_t File::size() const { return static_cast<std::uint64_t>(status_of(*this).st_size); }

void File::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  check_offset(*this, offset, bytes.size());
  while (!bytes.empty()) {
    const ssize_t count =
        ::pread(fd_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0)
      throw system_error(fmt::format("read {} bytes at offset {} of", bytes.size(), offset),
                         path_.string(), errno);
    if (count == 0)
      throw DamageError(fmt::format("'{}' ends at offset {}, {} bytes too early", path_.string(),
                                    offset, bytes.size()));
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
}

std::string File::text_at(std::uint64_t offset, std::uint64_t max_size) const {
  const std::uint64_t end = size();
  offset = std::min(offset, end);
  std::string text(static_cast<std::size_t>(std::min(end - offset, max_size)), '\0');
  read_at(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

void File::will_need(std::uint64_t offset, std::uint64_t size) const {
  ::posix_fadvise(fd_.get(), static_cast<off_t>(offset), static_cast<off_t>(size),
                  POSIX_FADV_WILLNEED);
}

void File::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  check_offset(*this, offset, bytes.size());
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(fd_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw system_error("write", path_.string(), errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
}

void File::sync() {
  if (::fsync(fd_.get()) != 0) throw system_error("sync", path_.string(), errno);
}

void File::start_writeback(std::uint64_t offset, std::uint64_t size) {
  ::sync_file_range(fd_.get(), static_cast<off_t>(offset), static_cast<off_t>(size),
                    SYNC_FILE_RANGE_WRITE);
}

File open_input(const std::filesystem::path& path) {
  UniqueFd fd = open_to_read(path);
  if (fd.get() < 0) throw system_error("open", path.string(), errno);
  File file(std::move(fd), path);
  const mode_t mode = status_of(file).st_mode;
  if (S_ISDIR(mode)) throw UsageError(fmt::format("'{}' is a directory", path.string()));
  if (!S_ISREG(mode))
    throw UsageError(fmt::format(
        "'{}' is not a regular file (a pipe can be given as standard input, '-')", path.string()));
  return file;
}

File open_if_exists(const std::filesystem::path& path) {
  UniqueFd fd = open_to_read(path);
  if (fd.get() >= 0) return require_regular({std::move(fd), path});
  if (errno == ENOENT || errno == ENOTDIR) return {};
  if (errno == ENXIO) throw not_regular(path);  // a socket, or a device that is not there
  throw system_error("open", path.string(), errno);
}

File require_regular(File file) {
  if (!S_ISREG(status_of(file).st_mode)) throw not_regular(file.path());
  return file;
}

std::optional<std::string> read_small_file(const std::filesystem::path& path,
                                           std::uint64_t max_size) {
  const File file = open_if_exists(path);
  if (!file) return std::nullopt;
  const std::uint64_t size = file.size();
  if (size > max_size)
    throw DamageError(fmt::format("'{}' has {} bytes, more than the {} that make sense",
                                  path.string(), size, max_size));
  return file.text_at(0, size);
}

std::string quoted(const std::filesystem::path& path) { return fmt::format("'{}'", path.string()); }

}  // namespace isobrick

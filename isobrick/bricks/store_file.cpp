#include "isobrick/bricks/store_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <limits>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

constexpr std::string_view kTemporarySuffix = ".tmp";

off_t checked_offset(std::uint64_t offset, std::size_t size, const std::filesystem::path& path) {
  constexpr auto limit = static_cast<std::uint64_t>(std::numeric_limits<off_t>::max());
  if (offset > limit || size > limit - offset)
    throw DamageError(fmt::format("'{}': offset {} is out of bounds", path.string(), offset));
  return static_cast<off_t>(offset);
}

}  // namespace

StoreFile StoreFile::open_if_exists(const std::filesystem::path& path) {
  const auto no_file = [&] {
    return DamageError(fmt::format("'{}' is not a regular file", path.string()));
  };
  // Without O_NONBLOCK a FIFO here would wait for somebody who writes to it.
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (fd.get() < 0) {
    if (errno == ENOENT) return {};
    if (errno == ENXIO) throw no_file();  // a socket, or a device that is not there
    throw system_error("open", path.string(), errno);
  }
  struct stat status {};
  if (::fstat(fd.get(), &status) != 0) throw system_error("examine", path.string(), errno);
  if (!S_ISREG(status.st_mode)) throw no_file();
  return {std::move(fd), path};
}

std::uint64_t StoreFile::size() const {
  struct stat status {};
  if (::fstat(fd_.get(), &status) != 0) throw system_error("examine", path_.string(), errno);
  return static_cast<std::uint64_t>(status.st_size);
}

void StoreFile::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  checked_offset(offset, bytes.size(), path_);
  while (!bytes.empty()) {
    const ssize_t count =
        ::pread(fd_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0) {
      if (errno == EINTR) continue;
      throw system_error(fmt::format("read {} bytes at {} of", bytes.size(), offset),
                         path_.string(), errno);
    }
    if (count == 0)
      throw DamageError(
          fmt::format("'{}' ends at {}, {} bytes too early", path_.string(), offset, bytes.size()));
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
}

void StoreFile::will_need(std::uint64_t offset, std::uint64_t size) const {
  ::posix_fadvise(fd_.get(), static_cast<off_t>(offset), static_cast<off_t>(size),
                  POSIX_FADV_WILLNEED);
}

void StoreFile::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  checked_offset(offset, bytes.size(), path_);
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(fd_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0) {
      if (errno == EINTR) continue;
      throw system_error("write", path_.string(), errno);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
}

void StoreFile::sync() {
  if (::fsync(fd_.get()) != 0) throw system_error("sync", path_.string(), errno);
}

void StoreFile::start_writeback(std::uint64_t offset, std::uint64_t size) {
  ::sync_file_range(fd_.get(), static_cast<off_t>(offset), static_cast<off_t>(size),
                    SYNC_FILE_RANGE_WRITE);
}

std::string quoted(const std::filesystem::path& path) { return fmt::format("'{}'", path.string()); }

std::string read_small_file(const std::filesystem::path& path, std::uint64_t limit, bool* exists) {
  const StoreFile file = StoreFile::open_if_exists(path);
  *exists = static_cast<bool>(file);
  if (!file) return {};
  const std::uint64_t size = file.size();
  if (size > limit)
    throw DamageError(fmt::format("'{}' has {} bytes, more than the {} that make sense",
                                  path.string(), size, limit));
  std::string content(static_cast<std::size_t>(size), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(content)));
  return content;
}

std::filesystem::path temporary_name(const std::filesystem::path& path) {
  std::filesystem::path result = path;
  result += kTemporarySuffix;
  return result;
}

bool is_temporary_name(const std::filesystem::path& path) {
  return path.extension() == kTemporarySuffix;
}

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace isobrick {

/// Owns an open file descriptor.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~UniqueFd();

  int get() const { return fd_; }

 private:
  int fd_ = -1;
};

/// A regular file open for reading.
struct InputFile {
  UniqueFd fd;
  std::uint64_t size = 0;
};

/// Throws Error when `path` cannot be opened, UsageError when it is a
/// directory, a pipe or a device.
InputFile open_input(const std::string& path);

/// Fills `out` with the `size` bytes at `offset`; `path` is for the message of
/// the Error thrown when there are fewer.
void read_at(int fd, const std::string& path, std::uint64_t offset, std::byte* out,
             std::size_t size);

}  // namespace isobrick

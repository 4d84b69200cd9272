#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace isobrick::inline v0 {

/// Owns an open file descriptor; a negative one stands for none.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(other.release()) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~UniqueFd();

  int get() const { return fd_; }
  /// Hands the descriptor to the caller, who closes it.
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_ = -1;
};

/// A second descriptor of the same open file; negative, with errno set, on failure.
UniqueFd duplicate(int fd);

/// An open regular file that is read and written at offsets. Every Error names its path. Reads and
/// writes from several threads do not disturb each other.
class File {
 public:
  /// No file.
  File() = default;
  /// `path` is for messages.
  File(UniqueFd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}

  explicit operator bool() const { return fd_.get() >= 0; }
  int fd() const { return fd_.get(); }
  const std::filesystem::path& path() const { return path_; }
  /// After a rename: the path that messages name from now on.
  void set_path(std::filesystem::path path) { path_ = std::move(path); }

  /// The same open file under another descriptor. Throws Error.
  File share() const;

  /// Bytes of the file now. A system call.
  std::uint64_t size() const;
  /// Fills `bytes`; DamageError when the file ends before.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// The bytes from `offset` on: `max_size`, or fewer where the file ends before.
  std::string text_at(std::uint64_t offset, std::uint64_t max_size) const;
  /// Hints that these bytes are read soon. Starts the disk and waits for nothing.
  void will_need(std::uint64_t offset, std::uint64_t size) const;

  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Waits until what was written is on disk.
  void sync();
  /// Starts writing these bytes to the disk, so that a later sync finds little to do.
  void start_writeback(std::uint64_t offset, std::uint64_t size);

 private:
  UniqueFd fd_;
  std::filesystem::path path_;
};

/// Opens a file that the user named, for reading. Throws Error when it cannot be opened, UsageError
/// when it is a directory, a pipe or a device.
File open_input(const std::filesystem::path& path);

/// Opens a file of a store for reading; no file when there is none. Throws DamageError when it is a
/// directory, a pipe or a device. Waits for none of them.
File open_if_exists(const std::filesystem::path& path);

/// Returns `file` if it is a regular file; throws DamageError otherwise.
File require_regular(File file);

/// The whole content of a file of a store; nullopt when there is none. DamageError when it is
/// larger than `max_size`.
std::optional<std::string> read_small_file(const std::filesystem::path& path,
                                           std::uint64_t max_size);

/// How messages name a file: in single quotes.
std::string quoted(const std::filesystem::path& path);

}  // namespace isobrick

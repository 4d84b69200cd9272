#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include "isobrick/io/file.h"

namespace isobrick {

/// A file of a store. OutputFolder creates those that are written.
class StoreFile {
 public:
  StoreFile() = default;
  StoreFile(UniqueFd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}

  /// Opens an existing file for reading; an empty one when there is none.
  /// DamageError when it is a folder, a FIFO or the like; waits for none of them.
  static StoreFile open_if_exists(const std::filesystem::path& path);

  explicit operator bool() const { return fd_.get() >= 0; }
  const std::filesystem::path& path() const { return path_; }

  std::uint64_t size() const;
  /// Reads exactly bytes.size() bytes; DamageError when the file ends before.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Hints that these bytes are read soon; starts the disk, waits for nothing.
  void will_need(std::uint64_t offset, std::uint64_t size) const;
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  void sync();
  /// Starts writing these bytes to the disk, so that a later sync finds little to do.
  void start_writeback(std::uint64_t offset, std::uint64_t size);

 private:
  UniqueFd fd_;
  std::filesystem::path path_;
};

/// How messages name a file: in quotes.
std::string quoted(const std::filesystem::path& path);

/// The whole content; DamageError when the file is larger than `limit`. Says
/// through `exists` whether there is a file at all.
std::string read_small_file(const std::filesystem::path& path, std::uint64_t limit, bool* exists);

/// The name under which a file is written until it is whole.
std::filesystem::path temporary_name(const std::filesystem::path& path);
bool is_temporary_name(const std::filesystem::path& path);

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

namespace isobrick {

/// Owns a file descriptor.
class StoreFile {
 public:
  StoreFile() = default;
  StoreFile(int descriptor, std::filesystem::path path)
      : descriptor_(descriptor), path_(std::move(path)) {}
  StoreFile(StoreFile&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)) {}
  StoreFile& operator=(StoreFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    std::swap(path_, other.path_);
    return *this;
  }
  ~StoreFile();

  /// Opens an existing file for reading; an empty one when there is none.
  /// DamageError when it is a folder, a FIFO or the like; waits for none of them.
  static StoreFile open_if_exists(const std::filesystem::path& path);
  /// Creates the file, empty, or empties it. Makes the folders above as needed.
  static StoreFile create(const std::filesystem::path& path);
  /// Opens an existing file for writing.
  static StoreFile open_for_writing(const std::filesystem::path& path);

  explicit operator bool() const { return descriptor_ >= 0; }
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
  int descriptor_ = -1;
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

/// Gives a finished file its final name.
void rename_file(const std::filesystem::path& from, const std::filesystem::path& to);

/// Syncs the temporary file and gives it its final name.
void publish_file(StoreFile temporary, const std::filesystem::path& path);

/// Makes the entries of a directory durable.
void sync_directory(const std::filesystem::path& directory);

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace isobrick::inline v0 {

/// A regular file in memory, read only. Like everything mapped, it must not be cut short by others
/// in the meantime.
class MappedFile {
 public:
  /// Throws what open_input throws, and Error when it cannot be mapped.
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const { return {first_, size_}; }

  /// Notes that about so many bytes of mapped files have been read. After each kWindow of them
  /// the pages of all mapped files leave the process's memory; they stay in the system's cache and
  /// come back when they are read again. So a file of any size is read in little memory.
  static void note_read(std::size_t bytes);
  static constexpr std::size_t kWindow = std::size_t{16} << 20;

 private:
  const std::byte* first_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace isobrick

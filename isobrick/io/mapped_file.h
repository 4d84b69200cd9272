#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace isobrick {

/// A regular file in memory, read only; its pages come and go as they are used. Like
/// everything mapped, it must not be cut short by others in the meantime.
class MappedFile {
 public:
  /// Throws what open_input throws, and Error when it cannot be mapped.
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const { return {first_, size_}; }

 private:
  const std::byte* first_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <utility>

namespace isobrick::inline v0::gpu {

/// Memory of whole pages of its own, for the driver to lock: large pages where it is as large as
/// one. Touch it before: while the driver locks pages, others wait for
/// the driver.
class MappedPages {
 public:
  static constexpr std::size_t kPage = 4096, kLargePage = std::size_t{2} << 20;

  MappedPages() = default;
  /// Throws Error where there is no room.
  explicit MappedPages(std::size_t bytes);
  MappedPages(MappedPages&& other) noexcept { *this = std::move(other); }
  MappedPages& operator=(MappedPages&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    std::swap(mapping_, other.mapping_);
    std::swap(mapped_, other.mapped_);
    return *this;
  }
  ~MappedPages();

  std::byte* data() const { return data_; }
  /// A multiple of the page size.
  std::size_t bytes() const { return bytes_; }
  static constexpr std::size_t whole_pages(std::size_t bytes) {
    return (bytes + kPage - 1) / kPage * kPage;
  }
  /// Makes the system map the pages, by writing zeros to them.
  static void touch(std::byte* data, std::size_t bytes) {
    for (std::size_t at = 0; at < bytes; at += kPage)
      *static_cast<volatile std::byte*>(data + at) = std::byte{0};
  }

 private:
  std::byte* data_ = nullptr;
  std::size_t bytes_ = 0;
  void* mapping_ = nullptr;
  std::size_t mapped_ = 0;
};

}  // namespace isobrick::gpu

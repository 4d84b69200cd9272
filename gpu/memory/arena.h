#pragma once

#include <cstddef>
#include <limits>

#include <isobrick/error.h>

namespace isobrick::inline v0::gpu {

/// Hands out slices of one buffer from the front, in device memory or on the host. Owns nothing.
class Arena {
 public:
  /// What memory transfers and vector loads want at most.
  static constexpr std::size_t kAlign = 256;
  static constexpr std::size_t aligned(std::size_t bytes, std::size_t align = kAlign) {
    return (bytes + align - 1) / align * align;
  }

  /// Slices begin at multiples of `align` bytes from `data`.
  Arena(std::byte* data, std::size_t bytes, std::size_t align = kAlign)
      : data_(data), bytes_(bytes), align_(align) {}
  /// No buffer: used() measures what slices take, and they must not be touched.
  Arena() : Arena(nullptr, std::numeric_limits<std::size_t>::max()) {}

  /// The next `count` elements, uninitialised. Throws Error where the buffer ends before.
  template <class T>
  T* take(std::size_t count) {
    const std::size_t at = aligned(used_, align_);
    if (at > bytes_ || count > (bytes_ - at) / sizeof(T))
      throw Error("a buffer of the GPU backend is used up");
    used_ = at + count * sizeof(T);
    return data_ == nullptr ? nullptr : reinterpret_cast<T*>(data_ + at);
  }
  /// Bytes up to the end of the last slice.
  std::size_t used() const { return used_; }

 private:
  std::byte* data_;
  std::size_t bytes_, align_, used_ = 0;
};

}  // namespace isobrick::gpu

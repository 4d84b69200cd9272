#pragma once

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include <isobrick/api.h>

namespace isobrick::inline v0 {
namespace detail {

/// Bytes from which memory of the process lies in large pages: their rounding wastes little then.
inline constexpr std::size_t kLargeMemory = std::size_t{32} << 20;

/// Memory of `capacity` bytes, which begins with the first `used` bytes of `data`. Frees `data`, of
/// `old_capacity` bytes or null. Of `memory`, or of the process where that is null. Throws
/// std::bad_alloc; `data` is as it was then.
ISOBRICK_API void* grow_memory(std::pmr::memory_resource* memory, void* data, std::size_t used,
                               std::size_t old_capacity, std::size_t capacity);
/// Frees what grow_memory() gave; null is none.
ISOBRICK_API void free_memory(std::pmr::memory_resource* memory, void* data,
                              std::size_t capacity) noexcept;

}  // namespace detail

/// A growing array that neither initialises nor frees its memory: the thread that writes the values
/// touches it first, and clear() keeps it for reuse. Memory of the process grows without copying
/// where it is large, and lies in large pages then. Memory of a resource is aligned to 64 bytes.
template <class T>
class PodBuffer {
  static_assert(std::is_trivially_copyable_v<T>);
  static_assert(alignof(T) <= alignof(std::max_align_t), "memory of the process has no more");

 public:
  /// Empty, in memory of the process.
  PodBuffer() = default;
  /// Empty, in memory of `memory`, which must outlive it.
  explicit PodBuffer(std::pmr::memory_resource* memory) : memory_(memory) {}
  /// Leaves `other` empty.
  PodBuffer(PodBuffer&& other) noexcept
      : memory_(other.memory_),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  /// Exchanges the arrays.
  PodBuffer& operator=(PodBuffer&& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~PodBuffer() { detail::free_memory(memory_, data_, capacity_ * sizeof(T)); }

  /// The first element; may be null when the array is empty. Valid until the array grows.
  T* data() { return data_; }
  /// The same for reading.
  const T* data() const { return data_; }
  /// Number of elements.
  std::size_t size() const { return size_; }
  /// True when there is no element.
  bool empty() const { return size_ == 0; }
  /// What the memory is taken from; null: the process.
  std::pmr::memory_resource* memory() const { return memory_; }
  /// Elements that fit without growth.
  std::size_t capacity() const { return capacity_; }
  /// Element `i`, which must exist.
  T& operator[](std::size_t i) { return data_[i]; }
  /// The same for reading.
  const T& operator[](std::size_t i) const { return data_[i]; }
  /// The first element.
  T* begin() { return data_; }
  /// Behind the last element.
  T* end() { return data_ + size_; }
  /// The first element, for reading.
  const T* begin() const { return data_; }
  /// Behind the last element, for reading.
  const T* end() const { return data_ + size_; }
  /// All elements. Valid until the array grows.
  std::span<const T> span() const { return {data_, size_}; }

  /// Drops all elements and keeps the memory.
  void clear() { size_ = 0; }
  /// New elements hold no particular value.
  void resize(std::size_t size) {
    if (size > capacity_)
      reserve(size > capacity_ + capacity_ / 2 ? size : capacity_ + capacity_ / 2);
    size_ = size;
  }
  /// Makes room for so many elements. Throws std::bad_alloc.
  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    if (capacity > kMaxCapacity) throw std::bad_alloc();  // its bytes would wrap
    data_ = static_cast<T*>(detail::grow_memory(memory_, data_, size_ * sizeof(T),
                                                capacity_ * sizeof(T), capacity * sizeof(T)));
    capacity_ = capacity;
  }

 private:
  static constexpr std::size_t kMaxCapacity = PTRDIFF_MAX / sizeof(T);

  std::pmr::memory_resource* memory_ = nullptr;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace isobrick {

/// A growing array that neither initialises nor frees its memory: the thread that writes the values
/// touches it first, and clear() keeps it for reuse. Growth goes
/// through realloc, which moves large blocks by remapping pages.
template <class T>
class PodBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  PodBuffer() = default;
  /// Leaves `other` empty.
  PodBuffer(PodBuffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  /// Exchanges the arrays.
  PodBuffer& operator=(PodBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~PodBuffer() { std::free(data_); }

  /// The first element; may be null when the array is empty. Valid until the array grows.
  T* data() { return data_; }
  /// The same for reading.
  const T* data() const { return data_; }
  /// Number of elements.
  std::size_t size() const { return size_; }
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
    void* grown = std::realloc(static_cast<void*>(data_), capacity * sizeof(T));
    if (!grown) throw std::bad_alloc();
    data_ = static_cast<T*>(grown);
    capacity_ = capacity;
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace isobrick

#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "filters/scratch_pages.h"

namespace isobrick::inline v0 {

/// A random-access array whose memory is a given budget, whatever its size: what does not fit lies
/// in a nameless scratch file. Elements are accessed by reference into a resident page. A reference
/// or span is valid until the next access to the same array. For one thread at a time. Every access
/// may throw Error, where the disk is full for example.
template <class T>
class ScratchArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  /// Holds at most `memory` bytes, but one page at least.
  ScratchArray(const ScratchPlace& place, std::uint64_t memory)
      : shift_(static_cast<unsigned>(
                   std::bit_width(std::max<std::size_t>(1, place.page_bytes / sizeof(T)))) -
               1),
        pages_(place, sizeof(T) << shift_,
               static_cast<std::size_t>(memory / (sizeof(T) << shift_))) {}
  ScratchArray(ScratchArray&&) noexcept = default;
  ScratchArray& operator=(ScratchArray&&) noexcept = default;

  std::uint64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

  /// Element `i`, below size(), for reading.
  const T& operator[](std::uint64_t i) { return *at(i); }
  /// Element `i`, below size(), to be changed.
  T& edit(std::uint64_t i) {
    T* element = at(i);
    pages_.mark_changed();
    return *element;
  }

  void push_back(const T& value) {
    const T copy = value;  // it may lie in this array
    resize(size_ + 1);
    edit(size_ - 1) = copy;
  }
  /// Appends elements of somewhere else.
  void append(std::span<const T> values) {
    const std::uint64_t first = size_;
    resize(size_ + values.size());
    edit_runs(first, size_, [&](std::span<T> run, std::uint64_t begin) {
      std::memcpy(run.data(), values.data() + (begin - first), run.size_bytes());
    });
  }
  /// New elements have all bytes 0; more than before, or as many.
  void resize(std::uint64_t size) {
    size_ = size;
    pages_.require((size + mask()) >> shift_);
  }
  /// Drops all elements and keeps the memory.
  void clear() {
    forget_page();
    pages_.clear();
    size_ = 0;
  }
  /// Drops all elements, and frees memory and file.
  void release() {
    forget_page();
    pages_.release();
    size_ = 0;
  }

  /// Calls f(run, number of its first element) for the runs that make up the elements
  /// [begin, end), in order. `f` must not access this array.
  template <class F>
  void for_each_run(std::uint64_t begin, std::uint64_t end, F&& f) {
    while (begin < end) {
      const auto count = static_cast<std::size_t>(std::min(end, (begin | mask()) + 1) - begin);
      f(std::span<const T>(at(begin), count), begin);
      begin += count;
    }
  }
  /// The same for all elements.
  template <class F>
  void for_each_run(F&& f) {
    for_each_run(0, size_, f);
  }
  /// The same for elements that `f` changes.
  template <class F>
  void edit_runs(std::uint64_t begin, std::uint64_t end, F&& f) {
    while (begin < end) {
      const auto count = static_cast<std::size_t>(std::min(end, (begin | mask()) + 1) - begin);
      f(std::span<T>(&edit(begin), count), begin);
      begin += count;
    }
  }
  template <class F>
  void edit_runs(F&& f) {
    edit_runs(0, size_, f);
  }

  /// Pages in memory, and how many there are at most.
  std::size_t resident_pages() const { return pages_.resident(); }
  std::size_t max_resident_pages() const { return pages_.max_resident(); }
  /// Bytes of the resident pages at most.
  std::uint64_t memory() const { return pages_.max_resident() * (sizeof(T) << shift_); }
  /// Bytes of the scratch file.
  std::uint64_t file_bytes() const { return pages_.file_bytes(); }

 private:
  static constexpr std::uint64_t kNoPage = ~std::uint64_t{0};

  std::uint64_t mask() const { return (std::uint64_t{1} << shift_) - 1; }
  void forget_page() { page_ = kNoPage; }
  /// Mostly an element of the page of the last access.
  T* at(std::uint64_t i) {
    if (const std::uint64_t page = i >> shift_; page != page_) {
      page_ = kNoPage;  // should get() throw
      elements_ = reinterpret_cast<T*>(pages_.get(page));
      page_ = page;
    }
    return elements_ + (i & mask());
  }

  unsigned shift_;  ///< a page has 2^shift_ elements
  ScratchPages pages_;
  std::uint64_t size_ = 0;
  std::uint64_t page_ = kNoPage;  ///< of the last access
  T* elements_ = nullptr;         ///< of that page
};

}  // namespace isobrick

#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

namespace isobrick::inline v0 {

/// Which parts of [0, size) are free; the first that is large enough is taken.
class FreeList {
 public:
  explicit FreeList(std::uint32_t size) { free_.push_back({0, size}); }

  /// Whether take() would give something.
  bool has(std::uint32_t size) const {
    return std::any_of(free_.begin(), free_.end(),
                       [&](const Range& range) { return range.size >= size; });
  }

  std::optional<std::uint32_t> take(std::uint32_t size) {
    free_.reserve(free_.size() + taken_ + 2);
    for (std::size_t i = 0; i < free_.size(); ++i) {
      if (free_[i].size < size) continue;
      const std::uint32_t at = free_[i].at;
      free_[i].at += size;
      free_[i].size -= size;
      if (free_[i].size == 0) free_.erase(free_.begin() + static_cast<std::ptrdiff_t>(i));
      ++taken_;
      return at;
    }
    return std::nullopt;
  }

  /// All of what was taken. Allocates nothing, so that destructors may call it.
  void give_back(std::uint32_t at, std::uint32_t size) noexcept {
    if (size == 0) return;
    --taken_;
    insert(at, size);
  }

  /// The end of what was taken: `kept` of `size` stay taken.
  void trim(std::uint32_t at, std::uint32_t size, std::uint32_t kept) {
    if (kept == size) return;
    free_.reserve(free_.size() + taken_ + 2);
    insert(at + kept, size - kept);
  }

 private:
  struct Range {
    std::uint32_t at, size;
  };

  void insert(std::uint32_t at, std::uint32_t size) noexcept {
    auto next = std::lower_bound(free_.begin(), free_.end(), at,
                                 [](const Range& range, std::uint32_t v) { return range.at < v; });
    next = free_.insert(next, {at, size});
    if (next + 1 != free_.end() && at + size == (next + 1)->at) {
      next->size += (next + 1)->size;
      free_.erase(next + 1);
    }
    if (next != free_.begin() && (next - 1)->at + (next - 1)->size == at) {
      (next - 1)->size += next->size;
      free_.erase(next);
    }
  }

  std::vector<Range> free_;  ///< ascending, never touching; has room for all that is taken
  std::size_t taken_ = 0;
};

}  // namespace isobrick

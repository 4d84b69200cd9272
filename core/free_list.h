#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

namespace isobrick {

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
    for (std::size_t i = 0; i < free_.size(); ++i) {
      if (free_[i].size < size) continue;
      const std::uint32_t at = free_[i].at;
      free_[i].at += size;
      free_[i].size -= size;
      if (free_[i].size == 0) free_.erase(free_.begin() + static_cast<std::ptrdiff_t>(i));
      return at;
    }
    return std::nullopt;
  }

  void give_back(std::uint32_t at, std::uint32_t size) {
    if (size == 0) return;
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

 private:
  struct Range {
    std::uint32_t at, size;
  };
  std::vector<Range> free_;  ///< ascending, never touching
};

}  // namespace isobrick

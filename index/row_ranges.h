#pragma once

#include <cstddef>
#include <vector>

#include <isobrick/range.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Rows of samples at equal distances, x next to each other.
struct RowBundle {
  const void* first = nullptr;  ///< sample, aligned
  Index width = 0;              ///< samples of a row
  Index rows = 0;               ///< of a plane
  Index planes = 0;
  Index row_stride = 0;    ///< samples from a row to the next
  Index plane_stride = 0;  ///< samples from a plane to the next
};

/// Lowers lo[x] to the least sample of column x over all rows and raises hi[x] to the largest, NaN
/// left out; both have the width and the type of the samples. Returns whether any sample is NaN.
bool merge_rows(ScalarType type, const RowBundle& bundle, void* lo, void* hi);

/// Smallest and largest sample of each column of some bundles, NaN left out.
template <class T>
class ColumnRanges {
 public:
  /// Forgets all; the bundles to come are so wide.
  void reset(Index width) {
    lo_.assign(static_cast<std::size_t>(width), ValueRange<T>::kHighest);
    hi_.assign(static_cast<std::size_t>(width), ValueRange<T>::kLowest);
  }
  /// Whether any of the samples is NaN.
  bool add(const RowBundle& bundle) {
    return merge_rows(scalar_type_of<T>, bundle, lo_.data(), hi_.data());
  }
  /// Of the columns from `begin` on, before `end`.
  ValueRange<T> over(Index begin, Index end) const {
    ValueRange<T> range;
    for (auto x = static_cast<std::size_t>(begin); x < static_cast<std::size_t>(end); ++x)
      range.include(ValueRange<T>{lo_[x], hi_[x]});
    return range;
  }

 private:
  std::vector<T> lo_, hi_;
};

}  // namespace isobrick

#pragma once

#include <limits>

namespace isobrick::inline v0 {

/// Smallest and largest sample of a set, NaN left out. The range of no sample
/// at all is inverted (lo > hi) and is stabbed by no isovalue.
template <class T>
struct ValueRange {
  /// Of the sample type.
  using Limits = std::numeric_limits<T>;
  /// No sample is below it.
  static constexpr T kLowest = Limits::has_infinity ? -Limits::infinity() : Limits::lowest();
  /// No sample is above it.
  static constexpr T kHighest = Limits::has_infinity ? Limits::infinity() : Limits::max();

  T lo = kHighest;  ///< the smallest sample
  T hi = kLowest;   ///< the largest sample

  friend constexpr bool operator==(const ValueRange&, const ValueRange&) = default;
  /// True of the range of no sample.
  constexpr bool empty() const { return hi < lo; }

  /// Extends the range to `v`. A comparison with NaN is false, so NaN never enters.
  constexpr void include(T v) {
    lo = v < lo ? v : lo;
    hi = v > hi ? v : hi;
  }
  /// Extends the range to all of `r`.
  constexpr void include(ValueRange r) {
    lo = r.lo < lo ? r.lo : lo;
    hi = r.hi > hi ? r.hi : hi;
  }
  /// True when an isosurface at `iso` passes: lo < iso <= hi.
  constexpr bool stabbed_by(double iso) const {
    return static_cast<double>(lo) < iso && iso <= static_cast<double>(hi);
  }
};

}  // namespace isobrick

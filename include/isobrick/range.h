#pragma once

#include <limits>

namespace isobrick {

/// Smallest and largest sample of a set, NaN left out. The range of no sample
/// at all is inverted (lo > hi) and is stabbed by no isovalue.
template <class T>
struct ValueRange {
  using Limits = std::numeric_limits<T>;
  static constexpr T kLowest = Limits::has_infinity ? -Limits::infinity() : Limits::lowest();
  static constexpr T kHighest = Limits::has_infinity ? Limits::infinity() : Limits::max();

  T lo = kHighest;
  T hi = kLowest;

  friend constexpr bool operator==(const ValueRange&, const ValueRange&) = default;
  constexpr bool empty() const { return hi < lo; }

  // A comparison with NaN is false, so NaN never enters.
  constexpr void include(T v) {
    lo = v < lo ? v : lo;
    hi = v > hi ? v : hi;
  }
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

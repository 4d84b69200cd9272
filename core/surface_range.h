#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <isobrick/range.h>

namespace isobrick::inline v0 {

/// The range of samples as stores keep it, in f64. Of 64-bit integers that are no f64: the nearest
/// one where all samples are equal, so that they stay equal, else the next ones below and above.
/// Rounding to the nearest never changes an order, so a value is within the range of its samples
/// when it is rounded to the nearest too.
template <class T>
ValueRange<double> surface_range(const ValueRange<T>& range) {
  if (range.empty()) return {};
  ValueRange<double> rounded{static_cast<double>(range.lo), static_cast<double>(range.hi)};
  if constexpr (std::is_integral_v<T> && sizeof(T) == 8) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr double end = std::is_signed_v<T> ? 0x1p63 : 0x1p64;
    if (range.lo == range.hi) return rounded;
    if (rounded.lo >= end || static_cast<T>(rounded.lo) > range.lo)
      rounded.lo = std::nextafter(rounded.lo, -infinity);
    if (rounded.hi < end && static_cast<T>(rounded.hi) < range.hi)
      rounded.hi = std::nextafter(rounded.hi, infinity);
  }
  return rounded;
}

}  // namespace isobrick

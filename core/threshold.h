#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include "core/host_device.h"

namespace isobrick::inline v0 {

/// An isovalue as a comparison in the sample type T: the smallest T that is not
/// below it. Then `iso <= sample` is `value <= sample` and `sample < iso` is
/// `sample < value`, exactly, for every sample but NaN.
template <class T>
struct Threshold {
  T value{};  ///< the largest T when there is none
  /// No T reaches the isovalue, because it is above all of T or is NaN.
  bool none = false;

  ISOBRICK_HD explicit Threshold(double isovalue) {
    using Limits = std::numeric_limits<T>;
    constexpr T largest = Limits::has_infinity ? Limits::infinity() : Limits::max();
    if constexpr (std::is_same_v<T, double>) {
      none = isovalue != isovalue;
      value = none ? largest : isovalue;
    } else if constexpr (std::is_same_v<T, float>) {
      // A conversion rounds to nearest; outside of float's finite values it is undefined.
      constexpr auto most = static_cast<double>(Limits::max());
      none = isovalue != isovalue;
      if (isovalue >= -most && isovalue <= most) {
        value = static_cast<float>(isovalue);
        if (static_cast<double>(value) < isovalue) value = std::nextafter(value, largest);
      } else if (isovalue < -most) {
        value = isovalue < -std::numeric_limits<double>::max() ? -largest : Limits::lowest();
      } else {
        value = largest;
      }
    } else {
      const double least = std::ceil(isovalue);
      none = !(least <= static_cast<double>(largest));
      value = none                                             ? largest
              : least <= static_cast<double>(Limits::lowest()) ? Limits::lowest()
                                                               : static_cast<T>(least);
    }
  }
};

}  // namespace isobrick

#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

namespace isobrick {

/// An isovalue as a comparison in T: the smallest T that is not below it.
/// For samples of T, `min < iso` is `min < value` and `iso <= max` is
/// `value <= max`, exactly. `none` when no range of T is stabbed because no T
/// reaches the isovalue, or because it is not a number.
template <class T>
struct StabValue {
  T value{};
  bool none = false;

  explicit StabValue(double iso) {
    using Limits = std::numeric_limits<T>;
    if (std::isnan(iso)) {
      none = true;
    } else if constexpr (std::is_same_v<T, double>) {
      value = iso;
    } else if constexpr (std::is_same_v<T, float>) {
      // Conversion rounds to nearest; outside of float's finite values it is undefined.
      constexpr auto most = static_cast<double>(Limits::max());
      value = iso > most    ? Limits::infinity()
              : iso < -most ? Limits::lowest()
                            : static_cast<T>(iso);
      if (iso == -std::numeric_limits<double>::infinity()) value = -Limits::infinity();
      if (static_cast<double>(value) < iso) value = std::nextafter(value, Limits::infinity());
    } else {
      const double least = std::ceil(iso);
      none = least > static_cast<double>(Limits::max());
      if (!none)
        value = least <= static_cast<double>(Limits::lowest()) ? Limits::lowest()
                                                               : static_cast<T>(least);
    }
  }
};

}  // namespace isobrick

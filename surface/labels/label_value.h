#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/label.h>
#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// The label that a sample is. Throws Error where it is no whole number.
template <class T>
Label label_of(T sample) {
  if constexpr (std::is_floating_point_v<T>) {
    constexpr T limit = T{2} / std::numeric_limits<T>::epsilon();
    if (!(std::abs(sample) <= limit) || sample != std::trunc(sample))
      throw Error(fmt::format(
          "a sample is {}, and labels are whole numbers of at most {:.0f}: this is no label image",
          sample, limit));
    return static_cast<std::int64_t>(sample);
  } else {
    return sample;
  }
}

/// The label of an image of this type whose bits are these, as files have them.
inline Label label_of_bits(std::uint64_t bits, ScalarType type) {
  if (type == ScalarType::u64) return bits;
  return static_cast<std::int64_t>(bits);
}

/// NaN has none.
template <class T>
bool has_label(T sample) {
  return sample == sample;
}

}  // namespace isobrick

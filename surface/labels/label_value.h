#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

/// The label that a sample is. Throws Error where it is no whole number.
template <class T>
std::int64_t label_of(T sample) {
  if constexpr (std::is_floating_point_v<T>) {
    constexpr T limit = T{2} / std::numeric_limits<T>::epsilon();
    if (!(std::abs(sample) <= limit) || sample != std::trunc(sample))
      throw Error(fmt::format(
          "a sample is {}, and labels are whole numbers of at most {:.0f}: this is no label image",
          sample, limit));
  }
  return static_cast<std::int64_t>(sample);
}

/// NaN has none.
template <class T>
bool has_label(T sample) {
  return sample == sample;
}

}  // namespace isobrick

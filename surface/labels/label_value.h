#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

/// The label that a sample is; of u64 beyond 2⁶³ the negative one of the same bits. Throws Error
/// where it is no whole number, and for the bits of −2⁶³, for which label_key() has no room.
template <class T>
std::int64_t label_of(T sample) {
  if constexpr (std::is_floating_point_v<T>) {
    constexpr T limit = T{2} / std::numeric_limits<T>::epsilon();
    if (!(std::abs(sample) <= limit) || sample != std::trunc(sample))
      throw Error(fmt::format(
          "a sample is {}, and labels are whole numbers of at most {:.0f}: this is no label image",
          sample, limit));
  }
  if constexpr (std::is_integral_v<T> && sizeof(T) == 8)
    if (static_cast<std::int64_t>(sample) == std::numeric_limits<std::int64_t>::min())
      throw Error(fmt::format("a sample is {}, which is no label", sample));
  return static_cast<std::int64_t>(sample);
}

/// NaN has none.
template <class T>
bool has_label(T sample) {
  return sample == sample;
}

}  // namespace isobrick

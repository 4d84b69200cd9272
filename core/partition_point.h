#pragma once

#include <cstdint>

#include "core/host_device.h"

namespace isobrick::inline v0 {

/// How many of 0, 1, … n − 1 satisfy a condition that holds up to some number and for none from
/// there on: a binary search.
template <class Condition>
ISOBRICK_HD constexpr std::uint32_t partition_point(std::uint32_t n, const Condition& holds) {
  std::uint32_t low = 0, high = n;
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (holds(middle))
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

}  // namespace isobrick

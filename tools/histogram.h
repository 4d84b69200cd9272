#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/progress.h"

namespace isobrick::tools {

/// How the samples of one level spread over their values.
struct Histogram {
  int level = 0;
  double lo = 0, hi = 0;              ///< of the finite samples
  double bin_width = 0;               ///< 0: all finite samples are equal
  std::vector<std::uint64_t> counts;  ///< from lo upwards; empty when no sample is finite
  std::uint64_t not_a_number = 0, infinite = 0;
};

/// The histogram of the finest level with at most 2²⁴ samples (or else of the
/// coarsest), read brick by brick.
Histogram histogram(const StoreReader& store, Progress& progress);

/// The counts as columns of block characters, `rows` lines high, with the values
/// below. Heights are square roots, so that a background does not hide the rest.
std::string draw(const Histogram& histogram, int rows);

}  // namespace isobrick::tools

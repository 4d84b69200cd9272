#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/progress.h"

namespace isobrick {

/// How the samples of one level spread over their values.
struct Histogram {
  int level = 0;
  double lo = 0, hi = 0;              ///< of the finite samples
  double bin_width = 0;               ///< 0: all finite samples are equal
  std::vector<std::uint64_t> counts;  ///< from lo upwards; empty when no sample is finite
  std::uint64_t not_a_number = 0, infinite = 0;
};

/// Why the histogram of a store takes more than `memory` bytes, or too many look-ups of files;
/// empty when it does not.
std::string why_no_histogram(const StoreReader& store, std::uint64_t memory);

/// The histogram, in at most so many bins, of the finest level with at most 2²⁴ samples (or
/// else of the coarsest), read brick by brick.
Histogram histogram(const StoreReader& store, Progress& progress, int most_bins = 64);

}  // namespace isobrick

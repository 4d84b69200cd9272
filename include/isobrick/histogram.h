#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick {

/// How the samples of one level spread over their values.
struct Histogram {
  int level = 0;                      ///< the level that was read
  double lo = 0;                      ///< the smallest finite sample
  double hi = 0;                      ///< the largest finite sample
  double bin_width = 0;               ///< 0: all finite samples are equal
  std::vector<std::uint64_t> counts;  ///< from lo upwards; empty when no sample is finite
  std::uint64_t not_a_number = 0;     ///< samples that are NaN
  std::uint64_t infinite = 0;         ///< infinite samples
  std::uint64_t left_out = 0;         ///< bricks that cannot be read
  std::string damage;                 ///< what is wrong with the first of them
};

/// Chunk files of a level that a command which answers in seconds looks for one by one.
inline constexpr Index kMaxLookups = Index{1} << 20;

/// Why the histogram of a store takes more than `memory` bytes, or too many look-ups of files;
/// empty when it does not.
std::string why_no_histogram(const StoreReader& store, std::uint64_t memory);

/// The histogram, in at most so many bins, of the finest level with at most 2²⁴ samples (or
/// else of the coarsest), read brick by brick. Throws Error for a brick that cannot be read, unless
/// those are to be left out and others are left.
Histogram histogram(const StoreReader& store, Progress& progress, int max_bins = 64,
                    bool leaves_out = false);

}  // namespace isobrick

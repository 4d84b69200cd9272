#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/storage.h>
#include <isobrick/vec.h>
#include "bricks/zarr/publisher.h"

// The histogram of level 0: how many samples each bin has, as an array below isobrick/0, and which
// values the bins are of, in isobrick/ranges.json.

namespace isobrick::inline v0 {

inline constexpr Index kMaxHistogramBins = Index{1} << 16;

/// Bins of equal width for the finite samples of a level. The width is the smallest power of two
/// with which there are no more than kMaxHistogramBins, and at least 1 for whole numbers.
struct HistogramBins {
  int exponent = 0;        ///< a bin is 2^exponent wide
  std::int64_t first = 0;  ///< bin i covers the values in [first + i, first + i + 1) · 2^exponent
  Index count = 0;         ///< bins from that of `lo` to that of `hi`; 0: no sample is finite
  double lo = 0, hi = 0;   ///< the smallest and the largest finite sample
  std::uint64_t not_a_number = 0;  ///< samples that are NaN
  std::uint64_t infinite = 0;      ///< infinite samples

  friend bool operator==(const HistogramBins&, const HistogramBins&) = default;
};

/// Exact counts of all samples of a level.
struct SampleCounts {
  HistogramBins bins;
  std::vector<std::uint64_t> counts;  ///< of each bin

  friend bool operator==(const SampleCounts&, const SampleCounts&) = default;
};

/// What ranges.json keeps of the counts.
struct StoredHistogram {
  HistogramBins bins;
  std::uint32_t crc32c = 0;  ///< the checksum that the array's chunk ends with

  friend bool operator==(const StoredHistogram&, const StoredHistogram&) = default;
};

/// Where the counts lie in a store, below `additions`: both are keys.
std::string histogram_folder(const std::string& additions);

/// Writes the array of the counts.
StoredHistogram write_histogram(const std::filesystem::path& folder, const SampleCounts& counts,
                                Publisher& publisher);

/// Reads it from `folder`, a key. Throws DamageError for another array, and unless there are
/// `samples` counts in all.
SampleCounts read_histogram(const Storage& storage, const std::string& folder,
                            const StoredHistogram& stored, std::uint64_t samples);

}  // namespace isobrick

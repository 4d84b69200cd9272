#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/progress.h>
#include <isobrick/range.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// How the samples of one level spread over their values. Bin i has the samples from
/// first + i * bin_width to below first + (i + 1) * bin_width.
struct Histogram {
  int level = 0;                        ///< the level that was read
  double lo = ValueRange<double>().lo;  ///< the smallest finite sample; above hi if there is none
  double hi = ValueRange<double>().hi;  ///< the largest finite sample
  double first = 0;                     ///< lower bound of the first bin, at most lo
  double bin_width = 0;                 ///< 0: all finite samples are equal
  bool whole_numbers = false;           ///< samples and bounds are integers
  std::vector<std::uint64_t> counts;    ///< from first upwards; empty when no sample is finite
  std::uint64_t not_a_number = 0;       ///< samples that are NaN
  std::uint64_t infinite = 0;           ///< infinite samples
  std::uint64_t left_out = 0;           ///< bricks that cannot be read
  std::string damage;                   ///< what is wrong with the first of them
};

/// Chunk files of a level that a command which answers in seconds looks for one by one.
inline constexpr Index kMaxLookups = Index{1} << 20;

/// The histogram of level 0 that a store keeps; nullopt if it keeps none. It has at most 65,536
/// bins, of integers of 8 and 16 bits one for each value. Reads no samples. Throws DamageError
/// where it is damaged.
ISOBRICK_API std::optional<Histogram> stored_histogram(const StoreReader& store);

/// Why the histogram of a store that keeps none takes more than `memory` bytes, or too many
/// look-ups of files; empty when it does not.
ISOBRICK_API std::string why_no_histogram(const StoreReader& store, std::uint64_t memory);

/// A histogram in at most so many bins: the stored one or, where there is none, that of the finest
/// level with at most 2²⁴ samples (or else of the coarsest), read brick by brick. Throws
/// DamageError for a damaged one, and Error for a brick that cannot be read, unless those are to be
/// left out and others are left.
ISOBRICK_API Histogram histogram(const StoreReader& store, Progress& progress = no_progress(),
                                 int max_bins = 64, bool leaves_out = false);

/// The same samples in at most so many bins of equal width, the first of which begins at lo: for
/// drawings. The samples of a bin stay together, so those near bounds may be in the bin beside.
ISOBRICK_API Histogram rebin(const Histogram& histogram, int max_bins);

/// The threshold that splits the samples into two classes with the largest variance between them
/// (N. Otsu, A threshold selection method from gray-level histograms, IEEE Trans. Syst. Man Cybern.
/// 9, 1979): the centre of the last bin of the lower class, which is that of scikit-image's
/// threshold_otsu for the same bins. Of integers in bins of width 1 it is the value itself. nullopt
/// where fewer than two bins have samples.
ISOBRICK_API std::optional<double> otsu(const Histogram& histogram);

/// The value that `percent` percent of the finite samples do not exceed. Of integers in bins of
/// width 1 it is a sample, numpy.percentile's of method "inverted_cdf"; otherwise samples count as
/// spread evenly over their bin. nullopt where no sample is finite, or for less than 0 percent or
/// more than 100.
ISOBRICK_API std::optional<double> percentile(const Histogram& histogram, double percent);

/// The smallest or the largest sample if it lies so far from all others that these share a few
/// bins, as values that stand for missing samples do (-9999, -1e30). otsu() and percentile() are
/// no better than these bins are wide. nullopt where there is none, and of integers in bins of
/// width 1, which are exact.
ISOBRICK_API std::optional<double> far_value(const Histogram& histogram);

}  // namespace isobrick

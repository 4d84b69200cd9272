#include <isobrick/histogram.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace isobrick::inline v0 {
namespace {

std::uint64_t sum_of(const Histogram& h) {
  return std::accumulate(h.counts.begin(), h.counts.end(), std::uint64_t{0});
}

/// The value at a place in the bins, which is 0.5 in the middle of the first one.
double value_at(const Histogram& h, double place) {
  const double value = h.first + place * h.bin_width;
  // Bins of doubles may span more than the largest of them.
  return std::isfinite(value) ? value : (h.first / h.bin_width + place) * h.bin_width;
}

/// Bins of equal width from lo to hi; whole numbers get bins of whole width.
void lay_bins(Histogram& h, int max_bins) {
  const double span = h.hi - h.lo;
  h.first = h.lo;
  if (h.whole_numbers) {
    h.bin_width = std::ceil((span + 1) / max_bins);
    h.counts.resize(static_cast<std::size_t>(std::floor(span / h.bin_width)) + 1);
  } else {
    // Halved first: the span of doubles may itself be no finite number.
    h.bin_width = h.hi / max_bins - h.lo / max_bins;
    h.counts.resize(h.bin_width > 0 ? static_cast<std::size_t>(max_bins) : 1);
  }
}

std::size_t bin_of(const Histogram& h, double value) {
  if (h.counts.size() == 1) return 0;
  // The difference of whole numbers is exact, and so are their bins' bounds; that of doubles
  // may itself be no finite number.
  const double span = value - h.lo;
  const double at = span <= std::numeric_limits<double>::max()
                        ? span / h.bin_width
                        : value / h.bin_width - h.lo / h.bin_width;
  return std::min(static_cast<std::size_t>(std::max(at, 0.0)), h.counts.size() - 1);
}

}  // namespace

Histogram rebin(const Histogram& histogram, int max_bins) {
  Histogram h = histogram;
  if (histogram.counts.empty()) return h;
  h.counts.clear();
  lay_bins(h, max_bins);
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    const double bound = value_at(histogram, static_cast<double>(i));
    h.counts[bin_of(h, std::clamp(bound, h.lo, h.hi))] += histogram.counts[i];
  }
  return h;
}

std::optional<double> otsu(const Histogram& h) {
  const std::size_t bins = h.counts.size();
  if (std::count_if(h.counts.begin(), h.counts.end(), [](auto n) { return n > 0; }) < 2)
    return std::nullopt;
  // Of all bins from i on. In numbers of bins, which changes no comparison.
  std::vector<double> weight_above(bins + 1), sum_above(bins + 1);
  for (std::size_t i = bins; i-- > 0;) {
    const auto n = static_cast<double>(h.counts[i]);
    weight_above[i] = weight_above[i + 1] + n;
    sum_above[i] = sum_above[i + 1] + n * static_cast<double>(i);
  }
  double weight = 0, sum = 0, largest = -1;
  std::size_t best = 0;
  for (std::size_t i = 0; i + 1 < bins; ++i) {
    const auto n = static_cast<double>(h.counts[i]);
    weight += n;
    sum += n * static_cast<double>(i);
    if (weight == 0 || weight_above[i + 1] == 0) continue;
    const double difference = sum / weight - sum_above[i + 1] / weight_above[i + 1];
    const double variance = weight * weight_above[i + 1] * difference * difference;
    if (variance > largest) largest = variance, best = i;
  }
  // The integers of a bin end one below its upper bound.
  const double middle = h.whole_numbers ? 0.5 - 0.5 / h.bin_width : 0.5;
  return value_at(h, static_cast<double>(best) + middle);
}

std::optional<double> far_value(const Histogram& h) {
  // Of so many bins the others may take one.
  constexpr std::ptrdiff_t few = 256;
  const auto bins = std::ssize(h.counts);
  if (bins < few || (h.whole_numbers && h.bin_width == 1)) return std::nullopt;
  const auto has_samples = [](std::uint64_t n) { return n > 0; };
  const auto above =
      std::find_if(h.counts.begin() + 1, h.counts.end(), has_samples) - h.counts.begin();
  if (bins - above <= bins / few) return h.lo;
  const auto below =
      std::find_if(h.counts.rbegin() + 1, h.counts.rend(), has_samples) - h.counts.rbegin();
  if (bins - below <= bins / few) return h.hi;
  return std::nullopt;
}

std::optional<double> percentile(const Histogram& h, double percent) {
  if (h.counts.empty() || !(percent >= 0 && percent <= 100)) return std::nullopt;
  const double rank = static_cast<double>(sum_of(h)) * (percent / 100);
  const bool values = h.whole_numbers && h.bin_width == 1;
  // A sample is the first of its value that has at least `rank` samples up to it.
  const double wanted = values ? std::max(1.0, std::ceil(rank)) : rank;
  double below = 0;
  for (std::size_t i = 0; i < h.counts.size(); ++i) {
    const auto n = static_cast<double>(h.counts[i]);
    if (n > 0 && below + n >= wanted) {
      const double inside = values ? 0 : std::clamp((wanted - below) / n, 0.0, 1.0);
      return std::clamp(value_at(h, static_cast<double>(i) + inside), h.lo, h.hi);
    }
    below += n;
  }
  return h.hi;
}

}  // namespace isobrick

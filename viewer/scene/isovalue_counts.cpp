#include "viewer/scene/isovalue_counts.h"

#include <algorithm>
#include <cmath>

namespace isobrick::inline v0 {
namespace {

/// Number of values between which block counts are interpolated.
constexpr std::size_t kMaxEdges = 1 << 16;

/// Calls f(RangeTable) for all items, a few range chunks at a time.
template <class Read, class F>
void for_each_table(Int3 items, Read&& read, F&& f) {
  constexpr Index n = StoreReader::kRangeChunk;
  const Int3 edge{n, n, n};
  for_each_point({{0, 0, 0}, ceil_div(items, edge)}, [&](Int3 c) {
    f(read(intersect({c * edge, (c + Int3{1, 1, 1}) * edge}, {{0, 0, 0}, items})));
  });
}

std::uint64_t count_below(const std::vector<double>& sorted, double value) {
  return static_cast<std::uint64_t>(std::lower_bound(sorted.begin(), sorted.end(), value) -
                                    sorted.begin());
}

}  // namespace

IsovalueCounts::IsovalueCounts(const BrickSource& source, int level) {
  read_bricks(source, level);
  read_blocks(source, level);
}

void IsovalueCounts::read_bricks(const BrickSource& source, int level) {
  const Int3 items = source.info().levels[static_cast<std::size_t>(level)].lattice.bricks();
  bricks_ = static_cast<std::uint64_t>(volume(items));
  for_each_table(
      items, [&](Box3 box) { return source.brick_ranges(level, box); },
      [&](const RangeTable& table) {
        for (const ValueRange<double>& r : table.ranges) {
          if (r.empty()) continue;
          range_.include(r);
          lo_.push_back(r.lo);
          hi_.push_back(r.hi);
        }
      });
  std::sort(lo_.begin(), lo_.end());
  std::sort(hi_.begin(), hi_.end());
}

/// The edges are bounds of bricks, so that they are dense where surfaces change.
void IsovalueCounts::read_blocks(const BrickSource& source, int level) {
  std::vector<double> bounds = lo_;
  bounds.insert(bounds.end(), hi_.begin(), hi_.end());
  // Few bricks have few bounds, so even steps are added.
  const bool whole = !is_floating(source.info().type);
  for (int i = 0; i <= 256 && !range_.empty(); ++i) {
    const double edge = range_.lo + (range_.hi / 256 - range_.lo / 256) * i;
    bounds.push_back(whole ? std::round(edge) : edge);
  }
  std::sort(bounds.begin(), bounds.end());
  bounds.erase(std::unique(bounds.begin(), bounds.end()), bounds.end());
  const std::size_t step = bounds.size() / kMaxEdges + 1;
  for (std::size_t i = 0; i < bounds.size(); i += step) edges_.push_back(bounds[i]);
  if (!bounds.empty() && edges_.back() != bounds.back()) edges_.push_back(bounds.back());
  // First counts the bounds in each position, then sums them up. Position 2 i is edge i itself,
  // where all bounds of integers lie; position 2 i + 1 is the interval after it.
  lo_below_.assign(2 * edges_.size(), 0);
  hi_below_.assign(2 * edges_.size(), 0);
  const auto place = [&](double v) {
    const auto at = std::upper_bound(edges_.begin(), edges_.end(), v) - edges_.begin() - 1;
    const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(at, 0));
    return 2 * i + (v > edges_[i] ? 1 : 0);
  };
  const Int3 items = source.info().levels[static_cast<std::size_t>(level)].lattice.blocks();
  blocks_ = static_cast<std::uint64_t>(volume(items));
  for_each_table(
      items, [&](Box3 box) { return source.block_ranges(level, box); },
      [&](const RangeTable& table) {
        for (const ValueRange<double>& r : table.ranges) {
          if (r.empty() || edges_.empty()) continue;
          ++lo_below_[place(r.lo)];
          ++hi_below_[place(r.hi)];
        }
      });
  for (std::size_t i = 1; i < lo_below_.size(); ++i) {
    lo_below_[i] += lo_below_[i - 1];
    hi_below_[i] += hi_below_[i - 1];
  }
}

std::uint64_t IsovalueCounts::active_bricks(double isovalue) const {
  return count_below(lo_, isovalue) - count_below(hi_, isovalue);
}

std::uint64_t IsovalueCounts::active_blocks(double isovalue) const {
  if (!range_.stabbed_by(isovalue)) return 0;
  // edges_[at - 1] < isovalue <= edges_[at]
  const auto at = static_cast<std::size_t>(
      std::lower_bound(edges_.begin(), edges_.end(), isovalue) - edges_.begin());
  if (at == 0 || at >= edges_.size()) return 0;
  const double width = edges_[at] - edges_[at - 1];
  const double part = width > 0 ? (isovalue - edges_[at - 1]) / width : 1;
  const auto below = [&](const std::vector<std::uint64_t>& counts) {
    const auto edge = static_cast<double>(counts[2 * at - 2]);
    return edge + part * (static_cast<double>(counts[2 * at - 1]) - edge);
  };
  return static_cast<std::uint64_t>(std::max(0.0, below(lo_below_) - below(hi_below_)));
}

}  // namespace isobrick

#include "pipeline/labels/label_search.h"

#include <algorithm>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

LabelSelection::LabelSelection(std::vector<LabelRange> ranges, std::int64_t background)
    : ranges_(std::move(ranges)), background_(background) {
  for (const LabelRange& range : ranges_)
    if (range.last < range.first)
      throw UsageError(
          fmt::format("the range of labels {}:{} ends before it begins", range.first, range.last));
  std::sort(ranges_.begin(), ranges_.end(),
            [](const LabelRange& a, const LabelRange& b) { return a.first < b.first; });
  std::size_t kept = 0;
  for (const LabelRange& range : ranges_)
    if (kept > 0 && range.first <= ranges_[kept - 1].last)
      ranges_[kept - 1].last = std::max(ranges_[kept - 1].last, range.last);
    else
      ranges_[kept++] = range;
  ranges_.resize(kept);
}

bool LabelSelection::contains(std::int64_t label) const {
  if (ranges_.empty()) return label != background_;
  const auto after =
      std::upper_bound(ranges_.begin(), ranges_.end(), label,
                       [](std::int64_t l, const LabelRange& range) { return l < range.first; });
  return after != ranges_.begin() && label <= std::prev(after)->last;
}

bool LabelSelection::meets(double lo, double hi) const {
  const auto background = static_cast<double>(background_);
  if (ranges_.empty()) return lo <= hi && (lo != background || hi != background);
  // The first range that does not end before `lo`.
  const auto first = std::lower_bound(ranges_.begin(), ranges_.end(), lo,
                                      [](const LabelRange& range, double value) {
                                        return static_cast<double>(range.last) < value;
                                      });
  return first != ranges_.end() && static_cast<double>(first->first) <= hi;
}

bool LabelSearch::needs(Int3 block, const ValueRange<double>& range) const {
  if (range.empty() || !labels_.meets(range.lo, range.hi)) return false;
  if (range.lo != range.hi || store_.info().may_have_nan) return true;
  // Cells at the border have their lower corner one before the region, or on its last sample.
  const Int3 lo = block * kBlockEdge, last = lo + Int3{kBlockEdge, kBlockEdge, kBlockEdge};
  for (int axis = 0; axis < 3; ++axis)
    if (lo[axis] <= roi_.lo[axis] || last[axis] >= roi_.hi[axis]) return true;
  return false;
}

void LabelSearch::append_tiles(Int3 chunk, Box3 box, std::span<const double>,
                               std::span<std::vector<TileWork>> tiles) {
  const RangeTable table = read_chunk_ranges(store_, level_, chunk);
  bytes_read_ += table.bytes_read;
  append_tiles_where(
      table.box, [&](Int3 block) { return needs(block, table.at(block)); }, tiles.front());
  std::erase_if(tiles.front(), [&](const TileWork& work) {
    return !box.contains(work.tile) || !range_.contains(work.tile);
  });
}

}  // namespace isobrick

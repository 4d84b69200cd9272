#include "pipeline/labels/label_search.h"

#include <vector>

#include "bricks/stored_index.h"

namespace isobrick::inline v0 {

LabelSearch::LabelSearch(const StoreReader& store, int level, const LabelSelection& labels,
                         Box3 roi, const TileRange& range, bool uses_lists)
    : store_(store), level_(level), labels_(labels), roi_(roi), range_(range) {
  // Of all labels ranges tell as much.
  if (uses_lists && labels.is_some() && has_index(store, level, kLabelIndex))
    lists_.emplace(store, level, labels);
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
  std::optional<ListedTiles> listed;
  if (lists_) {
    listed = lists_->find(chunk);
    if (!listed->any()) return;
  }
  const RangeTable table = read_chunk_ranges(store_, level_, chunk);
  bytes_read_ += table.bytes_read;
  append_tiles_where(
      table.box, [&](Int3 block) { return needs(block, table.at(block)); }, tiles.front());
  std::erase_if(tiles.front(), [&](const TileWork& work) {
    return !box.contains(work.tile) || !range_.contains(work.tile) ||
           (listed && !listed->may_have(work.tile));
  });
}

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <optional>

#include <isobrick/labels.h>
#include "core/tile_range.h"
#include "pipeline/labels/label_list_search.h"
#include "pipeline/labels/label_selection.h"
#include "stream/block_search.h"

namespace isobrick::inline v0 {

/// Finds the blocks that a label's boundary may pass through, by the ranges of blocks: those with a
/// chosen label in their range that have more than one value or lie at the region's border.
class LabelSearch final : public BlockSearch {
 public:
  /// Only tiles of `range`. Where the store has lists of labels and `uses_lists` is set, tiles
  /// without a chosen label are left out. The others must outlive it. Throws as StoredIndex does.
  LabelSearch(const StoreReader& store, int level, const LabelSelection& labels, Box3 roi,
              const TileRange& range, bool uses_lists);

  /// `isovalues` does not matter.
  void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                    std::span<std::vector<TileWork>> tiles) override;
  std::uint64_t range_bytes() const override { return bytes_read_; }
  std::uint64_t index_bytes() const override { return lists_ ? lists_->bytes_read() : 0; }

 private:
  bool needs(Int3 block, const ValueRange<double>& range) const;

  const StoreReader& store_;
  int level_;
  const LabelSelection& labels_;
  Box3 roi_;
  TileRange range_;
  std::optional<LabelListSearch> lists_;
  std::uint64_t bytes_read_ = 0;
};

}  // namespace isobrick

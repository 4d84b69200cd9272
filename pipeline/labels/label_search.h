#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/labels.h>
#include "core/tile_range.h"
#include "stream/block_search.h"

namespace isobrick::inline v0 {

/// The labels that are chosen.
class LabelSelection {
 public:
  /// Throws UsageError for a range that ends before it begins.
  LabelSelection(std::vector<LabelRange> ranges, std::int64_t background);

  bool contains(std::int64_t label) const;
  /// Whether a label from `lo` to `hi` may be chosen.
  bool meets(double lo, double hi) const;
  /// In ascending order, disjoint; none: all but the background.
  const std::vector<LabelRange>& ranges() const { return ranges_; }

 private:
  std::vector<LabelRange> ranges_;
  std::int64_t background_;
};

/// Finds the blocks that a label's boundary may pass through, by the ranges of blocks: those with a
/// chosen label in their range that have more than one value or lie at the region's border.
class LabelSearch final : public BlockSearch {
 public:
  /// Only tiles of `range`. The others must outlive it.
  LabelSearch(const StoreReader& store, int level, const LabelSelection& labels, Box3 roi,
              const TileRange& range)
      : store_(store), level_(level), labels_(labels), roi_(roi), range_(range) {}

  /// `isovalues` does not matter.
  void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                    std::span<std::vector<TileWork>> tiles) override;
  std::uint64_t range_bytes() const override { return bytes_read_; }

 private:
  bool needs(Int3 block, const ValueRange<double>& range) const;

  const StoreReader& store_;
  int level_;
  const LabelSelection& labels_;
  Box3 roi_;
  TileRange range_;
  std::uint64_t bytes_read_ = 0;
};

}  // namespace isobrick

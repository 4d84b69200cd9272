#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/brick_source.h"

namespace isobrick::inline v0 {

/// Counts how much of a level an isovalue stabs, in O(log n) a query.
class IsovalueCounts {
 public:
  /// Reads the brick and block ranges of a stored level. It keeps 16 bytes for each brick and at
  /// most 2 MB for blocks. Throws what reading ranges throws.
  explicit IsovalueCounts(const BrickSource& source, int level = 0);

  /// Number of bricks that the isovalue stabs; exact.
  std::uint64_t active_bricks(double isovalue) const;
  /// Estimate of the blocks that it stabs. Times StreamCounters::triangles_per_block it estimates
  /// the size of the surface.
  std::uint64_t active_blocks(double isovalue) const;

  std::uint64_t bricks() const { return bricks_; }
  std::uint64_t blocks() const { return blocks_; }
  /// Of all samples but NaN; empty if there are none.
  ValueRange<double> range() const { return range_; }

 private:
  void read_bricks(const BrickSource& source, int level);
  void read_blocks(const BrickSource& source, int level);

  std::uint64_t bricks_ = 0, blocks_ = 0;
  ValueRange<double> range_;
  std::vector<double> lo_, hi_;  ///< bounds of the bricks that are not empty, sorted
  /// For each edge: how many blocks have their lo (hi) at or below it, or below the next edge.
  std::vector<double> edges_;
  std::vector<std::uint64_t> lo_below_, hi_below_;
};

}  // namespace isobrick

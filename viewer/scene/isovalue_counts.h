#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/brick_source.h"

namespace isobrick {

/// How much of a level any isovalue touches, answered in O(log n).
class IsovalueCounts {
 public:
  /// Reads the brick and block ranges of a stored level; 16 bytes a brick and at
  /// most 2 MB for blocks are kept. Throws what reading them throws.
  explicit IsovalueCounts(const BrickSource& source, int level = 0);

  /// Bricks that the isovalue touches, exactly.
  std::uint64_t active_bricks(double isovalue) const;
  /// About how many of the 16³ blocks it touches; times the triangles of a block
  /// (StreamCounters::triangles_per_block) the size of the surface.
  std::uint64_t active_blocks(double isovalue) const;

  std::uint64_t bricks() const { return bricks_; }
  std::uint64_t blocks() const { return blocks_; }
  /// Of all samples but NaN; empty when there are none.
  ValueRange<double> range() const { return range_; }

 private:
  void read_bricks(const BrickSource& source, int level);
  void read_blocks(const BrickSource& source, int level);

  std::uint64_t bricks_ = 0, blocks_ = 0;
  ValueRange<double> range_;
  std::vector<double> lo_, hi_;  ///< of bricks that are not empty, each sorted
  /// Of blocks: how many have their lo, and their hi, at or below an edge, and below the next.
  std::vector<double> edges_;
  std::vector<std::uint64_t> lo_below_, hi_below_;
};

}  // namespace isobrick

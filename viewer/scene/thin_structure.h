#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <isobrick/range.h>
#include "core/thread_annotations.h"
#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

class NodeSamples;

/// Where coarse levels have lost what finer ones hold: thin structure that averaging, or leaving
/// samples out, has removed. Known to within a few cells of a level, for the levels of few
/// samples, which are read for that: the ranges of their blocks span far too much.
///
/// A patch is two cells of a level along each axis, four where the level has more than kNodeEdge,
/// and never less than a block of level 0. It is lost where level 0 crosses the isovalue in it and
/// the level itself does not, even within a cell of it. Thread-safe.
class ThinStructure {
 public:
  ThinStructure(const NodeGrid& grid, const StoreInfo& info);

  /// Takes the ranges of these blocks of level 0.
  void include(const RangeTable& table, Box3 blocks);
  /// After the ranges of all blocks: reads the samples of the levels, unless somebody does or has.
  /// Of a level that cannot be read nothing counts as lost. False when it did nothing. Throws
  /// OperationCancelled; then another call begins again.
  bool read(ResidentBricks& bricks, const CancellationToken& token);
  /// Whether read() has ended.
  bool known() const { return known_.load(std::memory_order_acquire); }

  /// Whether the node has lost a 128th of its patches that the isovalue crosses, or more: what is
  /// less may be noise. False until it is known.
  bool lost(const NodeKey& n, double isovalue) const;

  /// Once it is known.
  std::uint64_t bytes() const;

 private:
  using Ranges = std::vector<ValueRange<float>>;
  struct Level {
    int level = 0;
    Int3 edge;     ///< of a patch, samples of level 0; powers of two
    Int3 patches;  ///< how many there are
    Ranges own;    ///< of the level's field in a patch and a cell around it; empty: unknown
    Ranges below;  ///< of level 0 in a patch
  };

  void merge_below();
  void read_levels(ResidentBricks& bricks, const CancellationToken& token);
  Ranges own_ranges(const Level& level, NodeSamples& samples, const CancellationToken& token) const;

  const NodeGrid& grid_;
  Mutex mutex_;                        ///< of include()
  std::vector<Level> levels_;          ///< the finest first
  std::atomic<bool> claimed_ = false;  ///< somebody reads, or has read
  std::atomic<bool> known_ = false;    ///< from now on nothing changes
};

}  // namespace isobrick

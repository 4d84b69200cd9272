#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <isobrick/range.h>
#include "core/thread_annotations.h"
#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

class NodeSamples;

/// Where coarse levels have lost thin structure, which averaging or leaving out samples has
/// removed. The ranges of a coarse level's blocks are too wide for that, so the samples of the few
/// coarsest levels are read.
///
/// A patch is a box of two cells of a level along each axis, of four where the level is longer than
/// kNodeEdge, and at least a block of level 0. It is lost where level 0 crosses the isovalue within
/// it, and the level itself does not even within one cell around it. Thread-safe.
class ThinStructure {
 public:
  ThinStructure(const NodeGrid& grid, const StoreInfo& info);

  /// Adds the ranges of these blocks of level 0.
  void include(const RangeTable& table, Box3 blocks);
  /// Call it after the ranges of all blocks: reads the samples of the levels, unless another call
  /// does or has. A level that cannot be read counts as not lost. Returns false if it did nothing.
  /// After OperationCancelled another call starts again.
  bool read(ResidentBricks& bricks, const CancellationToken& token);
  /// Whether read() has finished.
  bool known() const { return known_.load(std::memory_order_acquire); }

  /// Whether the node has lost at least a 128th of its patches that the isovalue crosses; less may
  /// be noise. False until known().
  bool lost(const NodeKey& n, double isovalue) const;

  /// Bytes of host memory, once known.
  std::uint64_t bytes() const;

 private:
  using Ranges = std::vector<ValueRange<float>>;
  struct Level {
    int level = 0;
    Int3 edge;     ///< of a patch, in samples of level 0; powers of two
    Int3 patches;  ///< number of patches
    Ranges own;    ///< of the level's field in each patch and a cell around it; empty: unknown
    Ranges below;  ///< of level 0 in each patch
  };

  void merge_below();
  void read_levels(ResidentBricks& bricks, const CancellationToken& token);
  Ranges own_ranges(const Level& level, NodeSamples& samples, const CancellationToken& token) const;

  const NodeGrid& grid_;
  Mutex mutex_;                        ///< guards include()
  std::vector<Level> levels_;          ///< finest first
  std::atomic<bool> claimed_ = false;  ///< a call of read() runs or has finished
  std::atomic<bool> known_ = false;    ///< once true, nothing changes
};

}  // namespace isobrick

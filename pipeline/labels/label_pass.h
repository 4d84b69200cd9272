#pragma once

#include <tbb/concurrent_queue.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <isobrick/labels.h>
#include "core/cancellable_progress.h"
#include "core/tile.h"
#include "pipeline/labels/label_mesh.h"
#include "pipeline/labels/label_plan.h"
#include "pipeline/labels/label_search.h"
#include "pipeline/labels/label_spool.h"
#include "pipeline/workers.h"
#include "surface/labels/label_tile.h"

namespace isobrick::inline v0 {

/// What labels are extracted from.
struct LabelVolume {
  std::string name;  ///< for messages
  Lattice lattice;
  Transform transform;
};

/// Makes the meshes of labels: first the pieces of tiles, which wait in a spool, then from these
/// the meshes.
class LabelPass {
 public:
  /// Throws UsageError for a region or choice of labels that makes no sense.
  LabelPass(LabelVolume volume, const LabelOptions& options, const LabelPlan& plan,
            Progress& progress);

  Box3 roi() const { return roi_; }
  const LabelSelection& labels() const { return labels_; }
  /// The tiles that have a cell of the region, or one at its border.
  Box3 tiles() const;
  /// Layers of samples around a tile that it needs.
  Index reach() const { return LabelTile::sample_reach(smoothing_); }
  Workers& workers() { return workers_; }

  /// So many tiles will be made.
  void begin(std::uint64_t tiles);
  /// Makes the pieces of tiles that follow those before in Morton order. For one thread, in
  /// workers().
  void make(std::span<const TileWork> tiles, const TileSamples& samples);
  /// There are no more tiles. Passes the meshes on; what it took.
  LabelReport finish(const LabelVisitor& visit);

 private:
  std::uint64_t tile_bytes() const { return kTileVolume * volume_.lattice.sample_bytes(); }
  void check_label_memory() const;
  void check_named(const std::vector<LabelChain>& chains) const;
  MeshHeader header_of(const LabelChain& chain) const;
  void pass_on(const std::vector<LabelChain>& chains, const LabelVisitor& visit);

  LabelVolume volume_;
  const LabelOptions& options_;
  LabelPlan plan_;
  Box3 roi_;
  LabelSelection labels_;
  LabelSmoothing smoothing_;
  CancellableProgress progress_;
  LabelSpool spool_;
  Workers workers_;
  tbb::concurrent_queue<std::unique_ptr<LabelTile>> free_tiles_;
};

}  // namespace isobrick

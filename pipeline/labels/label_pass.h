#pragma once

#include <tbb/concurrent_queue.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include <isobrick/labels.h>
#include "core/cancellable_progress.h"
#include "core/tile.h"
#include "pipeline/labels/label_image.h"
#include "pipeline/labels/label_plan.h"
#include "pipeline/workers.h"
#include "surface/labels/label_tile.h"

namespace isobrick::inline v0 {

/// Makes the pieces of tiles.
class LabelPass {
 public:
  /// Takes the pieces of a tile, as LabelSpool::pack() packs them, in the order of the tiles.
  using Append = std::function<void(std::span<const std::byte> packed)>;

  /// `image` must outlive it. Throws UsageError for a region that makes no sense.
  LabelPass(const LabelImage& image, const LabelOptions& options, const LabelPlan& plan,
            Append append, Progress& progress);

  /// Layers of samples around a tile that it needs.
  Index reach() const { return LabelTile::sample_reach(image_.smoothing); }
  Workers& workers() { return workers_; }

  /// So many tiles will be made.
  void begin(std::uint64_t tiles);
  /// Makes the pieces of tiles that follow those before in Morton order. For one thread, in
  /// workers().
  void make(std::span<const TileWork> tiles, const TileSamples& samples);
  /// There are no more tiles.
  void end() { progress_.end(); }

 private:
  std::uint64_t tile_bytes() const { return kTileVolume * size_of(image_.type); }

  const LabelImage& image_;
  LabelPlan plan_;
  Append append_;
  CancellableProgress progress_;
  Workers workers_;
  tbb::concurrent_queue<std::unique_ptr<LabelTile>> free_tiles_;
};

}  // namespace isobrick

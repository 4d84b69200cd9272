#include "pipeline/labels/label_pass.h"

#include <utility>
#include <vector>

#include "pipeline/extract/mesh_header.h"
#include "pipeline/in_order.h"
#include "pipeline/labels/label_spool.h"

namespace isobrick::inline v0 {

Box3 LabelImage::tiles() const {
  const Int3 edge{kTileEdge, kTileEdge, kTileEdge};
  // Cells begin one sample before the region.
  const Int3 lo = max(roi.lo - Int3{1, 1, 1}, {0, 0, 0});
  return {floor_div(lo, edge), ceil_div(roi.hi, edge)};
}

LabelPass::LabelPass(const LabelImage& image, const LabelOptions& options, const LabelPlan& plan,
                     Append append, Progress& progress)
    : image_(image),
      plan_(plan),
      append_(std::move(append)),
      progress_(progress, options.cancel),
      workers_(plan.threads) {
  check_roi(image.roi, image.extent);
}

void LabelPass::begin(std::uint64_t tiles) {
  progress_.begin("extracting labels", tiles * tile_bytes());
}

void LabelPass::make(std::span<const TileWork> tiles, const TileSamples& samples) {
  /// A tile on its way.
  struct TileJob {
    Int3 tile;
    std::vector<std::byte> packed;
  };
  std::size_t taken = 0;
  run_in_order<TileJob>(
      plan_.tiles,
      [&](TileJob& job) {
        if (taken == tiles.size()) return false;
        job.tile = tiles[taken++].tile;
        return true;
      },
      [&](TileJob& job) {
        std::unique_ptr<LabelTile> tile;
        if (!free_tiles_.try_pop(tile)) tile = std::make_unique<LabelTile>(image_.smoothing);
        job.packed = LabelSpool::pack(job.tile, tile->make(samples, image_.type, job.tile,
                                                           image_.roi, [this](const Label& label) {
                                                             return image_.labels.contains(label);
                                                           }));
        free_tiles_.push(std::move(tile));
      },
      [&](TileJob& job) {
        append_(job.packed);
        progress_.advance(tile_bytes());
      });
}

}  // namespace isobrick

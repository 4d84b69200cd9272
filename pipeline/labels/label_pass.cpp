#include "pipeline/labels/label_pass.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/stopwatch.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/in_order.h"

namespace isobrick::inline v0 {
namespace {

/// A tile on its way to the spool.
struct TileJob {
  Int3 tile;
  std::vector<std::byte> packed;
};

}  // namespace

LabelPass::LabelPass(LabelVolume volume, const LabelOptions& options, const LabelPlan& plan,
                     Progress& progress)
    : volume_(std::move(volume)),
      options_(options),
      plan_(plan),
      roi_(options.roi.value_or(volume_.lattice.box())),
      labels_(options.labels, options.background),
      smoothing_(label_smoothing(options)),
      progress_(progress, options.cancel),
      spool_(options.scratch_beside.string()),
      workers_(plan.threads) {
  check_roi(roi_, volume_.lattice.extent);
}

Box3 LabelPass::tiles() const {
  const Int3 edge{kTileEdge, kTileEdge, kTileEdge};
  // Cells begin one sample before the region.
  const Int3 lo = max(roi_.lo - Int3{1, 1, 1}, {0, 0, 0});
  return {floor_div(lo, edge), ceil_div(roi_.hi, edge)};
}

void LabelPass::begin(std::uint64_t tiles) {
  progress_.begin("extracting labels", tiles * tile_bytes());
}

void LabelPass::make(std::span<const TileWork> tiles, const TileSamples& samples) {
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
        if (!free_tiles_.try_pop(tile)) tile = std::make_unique<LabelTile>(smoothing_);
        job.packed = LabelSpool::pack(
            tile->make(samples, volume_.lattice.type, job.tile, roi_,
                       [this](std::int64_t label) { return labels_.contains(label); }));
        free_tiles_.push(std::move(tile));
      },
      [&](TileJob& job) {
        spool_.append(job.tile, job.packed);
        check_label_memory();
        progress_.advance(tile_bytes());
      });
}

void LabelPass::check_label_memory() const {
  if (spool_.memory() <= plan_.label_bytes) return;
  throw UsageError(
      fmt::format("there are more than {} labels, and the memory budget has room for no more: "
                  "give more --memory, or choose --labels",
                  spool_.labels()));
}

/// Throws UsageError for a label that was named by itself and is not there.
void LabelPass::check_named(const std::vector<LabelChain>& chains) const {
  for (const LabelRange& range : labels_.ranges()) {
    if (range.first != range.last) continue;
    const auto at = std::lower_bound(
        chains.begin(), chains.end(), range.first,
        [](const LabelChain& chain, std::int64_t label) { return chain.label < label; });
    if (at == chains.end() || at->label != range.first)
      throw UsageError(fmt::format("{} has no label {}{}", volume_.name, range.first,
                                   roi_ != volume_.lattice.box() ? " in the region" : ""));
  }
}

MeshHeader LabelPass::header_of(const LabelChain& chain) const {
  // Half a sample beyond the region; smoothing may move a vertex to the border of its cell.
  const double beyond = smoothing_.iterations > 0 ? 1 : 0.5;
  const auto bounds = [&](Int3 first, Int3 last) {
    Vec3d lo, hi;
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = static_cast<double>(std::max(first[axis], roi_.lo[axis])) - beyond;
      hi[axis] = static_cast<double>(std::min(last[axis], roi_.hi[axis] - 1)) + beyond;
    }
    return world_bounds(volume_.transform, lo, hi);
  };
  const MeshBounds all = bounds(roi_.lo, roi_.hi);
  MeshHeader header{.world_lo = all.lo, .world_hi = all.hi};
  header.surface =
      bounds(chain.first_tile * kTileEdge, (chain.last_tile + Int3{1, 1, 1}) * kTileEdge);
  header.unit = unit_name(volume_.transform.unit);
  return header;
}

void LabelPass::pass_on(const std::vector<LabelChain>& chains, const LabelVisitor& visit) {
  std::uint64_t quads = 0;
  for (const LabelChain& chain : chains) quads += chain.quads;
  progress_.begin("writing meshes", 2 * quads * sizeof(Triangle));
  std::size_t next = 0;
  run_in_order<std::size_t>(
      plan_.meshes,
      [&](std::size_t& i) {
        i = next++;
        return i < chains.size();
      },
      [&](std::size_t& i) {
        visit(SpooledLabelMesh(spool_, chains[i], i, volume_.transform, header_of(chains[i]),
                               options_.cancel));
      },
      [&](std::size_t& i) { progress_.advance(2 * chains[i].quads * sizeof(Triangle)); });
  progress_.end();
}

LabelReport LabelPass::finish(const LabelVisitor& visit) {
  progress_.end();
  free_tiles_.clear();
  LabelReport report;
  report.scratch_bytes = spool_.bytes();
  const std::vector<LabelChain> chains = spool_.finish();
  check_named(chains);
  for (const LabelChain& chain : chains) {
    ++report.labels;
    report.vertices += chain.vertices;
    report.triangles += 2 * chain.quads;
  }
  const Stopwatch watch(report.write_seconds);
  workers_.execute([&] { pass_on(chains, visit); });
  return report;
}

}  // namespace isobrick

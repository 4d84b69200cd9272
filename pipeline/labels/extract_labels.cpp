#include <isobrick/labels.h>

#include <tbb/concurrent_queue.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/cancellable_progress.h"
#include "core/length_unit.h"
#include "core/stopwatch.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/in_order.h"
#include "pipeline/labels/label_mesh.h"
#include "pipeline/labels/label_plan.h"
#include "pipeline/labels/label_search.h"
#include "pipeline/workers.h"
#include "stream/batch_lookahead.h"
#include "stream/brick_cache.h"
#include "surface/labels/label_tile.h"

namespace isobrick::inline v0 {
namespace {

/// Tiles in one batch at most: the bricks of a batch are resident together.
constexpr std::size_t kBatchTiles = 256;

const LevelInfo& level_of(const StoreReader& store, const LabelOptions& options) {
  const StoreInfo& info = store.info();
  const auto levels = static_cast<int>(info.levels.size());
  if (options.level < 0 || options.level >= levels)
    throw UsageError(fmt::format("level {} does not exist: '{}' has levels 0 to {}", options.level,
                                 info.name, levels - 1));
  return info.levels[static_cast<std::size_t>(options.level)];
}

/// A tile on its way to the spool.
struct TileJob {
  Int3 tile;
  std::vector<std::byte> packed;
};

/// One extract_labels().
class LabelExtraction {
 public:
  LabelExtraction(const StoreReader& store, const LabelOptions& options, Progress& progress)
      : store_(store),
        options_(options),
        level_(level_of(store, options)),
        roi_(options.roi.value_or(level_.lattice.box())),
        labels_(options.labels, options.background),
        progress_(progress, options.cancel) {
    check_coordinates(level_.transform, level_.lattice.extent, "'" + store.info().name + "'");
    check_roi(roi_, level_.lattice.extent);
    smoothing_ = label_smoothing(options);
    plan_ = plan_label_memory(store, options);
  }

  LabelReport run(const LabelVisitor& visit) {
    {
      const Stopwatch watch(report_.seconds);
      const std::uint64_t bytes_before = store_.bytes_read();
      LabelSpool spool(options_.scratch_beside.string());
      Workers workers(plan_.threads);
      workers.execute([&] { fill(spool); });
      report_.bricks = static_cast<std::uint64_t>(volume(level_.lattice.bricks()));
      report_.bytes_read = store_.bytes_read() - bytes_before;
      report_.scratch_bytes = spool.bytes();
      const std::vector<LabelChain> chains = spool.finish();
      check_named(chains);
      const Stopwatch write_watch(report_.write_seconds);
      workers.execute([&] { pass_on(spool, chains, visit); });
    }
    return report_;
  }

 private:
  TileStream tiles() const {
    const Int3 edge{kTileEdge, kTileEdge, kTileEdge};
    // Cells begin one sample before the region.
    const Int3 lo = max(roi_.lo - Int3{1, 1, 1}, {0, 0, 0});
    return {std::make_unique<LabelSearch>(store_, options_.level, labels_, roi_),
            level_.lattice,
            {floor_div(lo, edge), ceil_div(roi_.hi, edge)}};
  }

  Index reach() const { return LabelTile::sample_reach(smoothing_); }
  std::uint64_t tile_bytes() const { return kTileVolume * level_.lattice.sample_bytes(); }

  /// Makes the pieces of all tiles.
  void fill(LabelSpool& spool) {
    std::uint64_t count = 0;
    for (TileStream counted = tiles(); counted.next();) ++count;
    progress_.begin("extracting labels", count * tile_bytes());
    TileStream stream = tiles();
    BatchPlanner planner(stream, level_.lattice, reach(), true, kBatchTiles, plan_.batch_bricks);
    const BrickReader reader(store_, options_.level);
    BatchLookahead batches(planner, reader);
    BrickCache cache(store_, options_.level, reach(), plan_.cache_bricks);
    const bool room_for_two = plan_.cache_bricks >= 2 * plan_.batch_bricks;
    const auto begin = [&](const TileBatch& batch) {
      return cache.begin(batch.bricks, batch.tiles.back().tile);
    };
    TileBatch now, next;
    std::unique_ptr<CachedBricks> bricks, next_bricks;
    if (batches.next(now)) bricks = begin(now);
    while (bricks) {
      const bool has_next = batches.next(next);
      if (has_next && room_for_two) next_bricks = begin(next);
      bricks->wait();
      make_batch(now.tiles, *bricks, spool);
      bricks.reset();
      if (has_next && !room_for_two) next_bricks = begin(next);
      bricks = std::move(next_bricks);
      std::swap(now, next);
    }
    report_.bricks_read = cache.bricks_read();
    report_.brick_reads = cache.reads();
    progress_.end();
  }

  void make_batch(std::span<const TileWork> tiles, const BrickLookup& bricks, LabelSpool& spool) {
    const BrickSamples samples(level_.lattice, bricks, store_.info().fill_value);
    std::size_t taken = 0;
    run_in_order<TileJob>(
        plan_.tiles,
        [&](TileJob& job) {
          if (taken == tiles.size()) return false;
          job.tile = tiles[taken++].tile;
          return true;
        },
        [&](TileJob& job) { make_tile(samples, job); },
        [&](TileJob& job) {
          spool.append(job.tile, job.packed);
          check_label_memory(spool);
          progress_.advance(tile_bytes());
        });
  }

  void make_tile(const TileSamples& samples, TileJob& job) {
    std::unique_ptr<LabelTile> tile;
    if (!free_tiles_.try_pop(tile)) tile = std::make_unique<LabelTile>(smoothing_);
    job.packed = LabelSpool::pack(
        tile->make(samples, level_.lattice.type, job.tile, roi_,
                   [this](std::int64_t label) { return labels_.contains(label); }));
    free_tiles_.push(std::move(tile));
  }

  void check_label_memory(const LabelSpool& spool) const {
    if (spool.memory() <= plan_.label_bytes) return;
    throw UsageError(
        fmt::format("there are more than {} labels, and the memory budget has room for no more: "
                    "give more --memory, or choose --labels",
                    spool.labels()));
  }

  /// Throws UsageError for a label that was named by itself and is not there.
  void check_named(const std::vector<LabelChain>& chains) const {
    for (const LabelRange& range : labels_.ranges()) {
      if (range.first != range.last) continue;
      const auto at = std::lower_bound(
          chains.begin(), chains.end(), range.first,
          [](const LabelChain& chain, std::int64_t label) { return chain.label < label; });
      if (at == chains.end() || at->label != range.first)
        throw UsageError(fmt::format("'{}' has no label {}{}", store_.info().name, range.first,
                                     roi_ != level_.lattice.box() ? " in the region" : ""));
    }
  }

  MeshHeader header_of(const LabelChain& chain) const {
    const auto bounds = [&](Int3 first, Int3 last) {
      constexpr double half = 0.5;
      Vec3d lo, hi;
      for (int axis = 0; axis < 3; ++axis) {
        lo[axis] = static_cast<double>(std::max(first[axis], roi_.lo[axis])) - half;
        hi[axis] = static_cast<double>(std::min(last[axis], roi_.hi[axis] - 1)) + half;
      }
      return world_bounds(level_.transform, lo, hi);
    };
    const MeshBounds all = bounds(roi_.lo, roi_.hi);
    MeshHeader header{.world_lo = all.lo, .world_hi = all.hi};
    header.surface =
        bounds(chain.first_tile * kTileEdge, (chain.last_tile + Int3{1, 1, 1}) * kTileEdge);
    header.unit = unit_name(level_.transform.unit);
    return header;
  }

  /// Passes the meshes on.
  void pass_on(const LabelSpool& spool, const std::vector<LabelChain>& chains,
               const LabelVisitor& visit) {
    free_tiles_.clear();
    for (const LabelChain& chain : chains) {
      ++report_.labels;
      report_.vertices += chain.vertices;
      report_.triangles += 2 * chain.quads;
    }
    progress_.begin("writing meshes", report_.triangles * sizeof(Triangle));
    std::size_t next = 0;
    run_in_order<std::size_t>(
        plan_.meshes,
        [&](std::size_t& i) {
          i = next++;
          return i < chains.size();
        },
        [&](std::size_t& i) {
          visit(SpooledLabelMesh(spool, chains[i], level_.transform, header_of(chains[i]),
                                 options_.cancel));
        },
        [&](std::size_t& i) { progress_.advance(2 * chains[i].quads * sizeof(Triangle)); });
    progress_.end();
  }

  const StoreReader& store_;
  const LabelOptions& options_;
  const LevelInfo& level_;
  Box3 roi_;
  LabelSelection labels_;
  CancellableProgress progress_;
  LabelSmoothing smoothing_;
  LabelPlan plan_;
  tbb::concurrent_queue<std::unique_ptr<LabelTile>> free_tiles_;
  LabelReport report_;
};

}  // namespace

LabelReport extract_labels(const StoreReader& store, const LabelOptions& options,
                           const LabelVisitor& visit, Progress& progress) {
  return LabelExtraction(store, options, progress).run(visit);
}

}  // namespace isobrick

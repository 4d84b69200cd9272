#include <isobrick/labels.h>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/labels/label_pass.h"
#include "stream/batch_lookahead.h"
#include "stream/brick_cache.h"

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

LabelVolume volume_of(const StoreReader& store, const LabelOptions& options) {
  const LevelInfo& level = level_of(store, options);
  const std::string name = fmt::format("'{}'", store.info().name);
  check_coordinates(level.transform, level.lattice.extent, name);
  return {name, level.lattice, level.transform};
}

TileStream tiles_of(const StoreReader& store, int level, const LabelPass& pass) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  return {std::make_unique<LabelSearch>(store, level, pass.labels(), pass.roi()), lattice,
          pass.tiles()};
}

/// Makes the pieces of all tiles. While those of one batch are made, the bricks of the next are
/// decoded by the same threads.
void make_all(const StoreReader& store, int level, const LabelPlan& plan, LabelPass& pass,
              LabelReport& report) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  TileStream stream = tiles_of(store, level, pass);
  BatchPlanner planner(stream, lattice, pass.reach(), true, kBatchTiles, plan.batch_bricks);
  const BrickReader reader(store, level);
  BatchLookahead batches(planner, reader);
  BrickCache cache(store, level, pass.reach(), plan.cache_bricks);
  const bool room_for_two = plan.cache_bricks >= 2 * plan.batch_bricks;
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
    pass.make(now.tiles, BrickSamples(lattice, *bricks, store.info().fill_value));
    bricks.reset();
    if (has_next && !room_for_two) next_bricks = begin(next);
    bricks = std::move(next_bricks);
    std::swap(now, next);
  }
  report.bricks = static_cast<std::uint64_t>(volume(lattice.bricks()));
  report.bricks_read = cache.bricks_read();
  report.brick_reads = cache.reads();
}

}  // namespace

LabelReport extract_labels(const StoreReader& store, const LabelOptions& options,
                           const LabelVisitor& visit, Progress& progress) {
  LabelReport read;
  LabelReport report;
  {
    const Stopwatch watch(read.seconds);
    const std::uint64_t bytes_before = store.bytes_read();
    const LabelVolume volume = volume_of(store, options);
    const LabelPlan plan = plan_label_memory(store, options);
    LabelPass pass(volume, options, plan, progress);
    std::uint64_t tiles = 0;
    for (TileStream counted = tiles_of(store, options.level, pass); counted.next();) ++tiles;
    pass.begin(tiles);
    pass.workers().execute([&] { make_all(store, options.level, plan, pass, read); });
    read.bytes_read = store.bytes_read() - bytes_before;
    report = pass.finish(visit);
  }
  report.bricks = read.bricks;
  report.bricks_read = read.bricks_read;
  report.brick_reads = read.brick_reads;
  report.bytes_read = read.bytes_read;
  report.seconds = read.seconds;
  return report;
}

}  // namespace isobrick

#include "pipeline/labels/store_label_pass.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include <isobrick/error.h>
#include "pipeline/extract/mesh_header.h"
#include "pipeline/labels/label_search.h"
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

/// Makes the pieces of all tiles. While those of one batch are made, the bricks of the next are
/// decoded by the same threads.
void make_all(const StoreReader& store, int level, TileStream stream, const LabelPlan& plan,
              LabelPass& pass, LabelReport& report) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
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

LabelImage label_image_of(const StoreReader& store, const LabelOptions& options) {
  const LevelInfo& level = level_of(store, options);
  LabelImage image{.name = fmt::format("'{}'", store.info().name),
                   .extent = level.lattice.extent,
                   .type = level.lattice.type,
                   .transform = level.transform,
                   .roi = options.roi.value_or(level.lattice.box()),
                   .labels = {options.labels, options.background},
                   .smoothing = label_smoothing(options)};
  check_coordinates(image.transform, image.extent, image.name);
  check_roi(image.roi, image.extent);
  return image;
}

TileStream label_tiles(const StoreReader& store, int level, const LabelImage& image,
                       const TileRange& range, bool uses_lists) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  TileStream tiles(
      std::make_unique<LabelSearch>(store, level, image.labels, image.roi, range, uses_lists),
      lattice, image.tiles());
  tiles.restrict_to(range);
  return tiles;
}

LabelReport run_label_pass(const StoreReader& store, const LabelOptions& options,
                           const LabelImage& image, const LabelPlan& plan, const TileRange& range,
                           LabelPass::Append append, Progress& progress) {
  LabelReport report;
  const std::uint64_t bytes_before = store.bytes_read();
  LabelPass pass(image, options, plan, std::move(append), progress);
  const auto tiles = [&] {
    return label_tiles(store, options.level, image, range, options.use_lists);
  };
  std::uint64_t count = 0;
  TileStream counted = tiles();
  while (counted.next()) ++count;
  report.index_bytes = counted.index_bytes();
  pass.begin(count);
  pass.workers().execute([&] { make_all(store, options.level, tiles(), plan, pass, report); });
  pass.end();
  report.bytes_read = store.bytes_read() - bytes_before;
  return report;
}

}  // namespace isobrick

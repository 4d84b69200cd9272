#include "pipeline/labels/label_plan.h"

#include <algorithm>

#include <fmt/format.h>
#include <tbb/info.h>

#include <isobrick/error.h>
#include "core/tile.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/labels/label_list_search.h"
#include "pipeline/labels/label_spool.h"
#include "pipeline/program_memory.h"
#include "surface/labels/label_tile.h"

namespace isobrick::inline v0 {
namespace {

/// What takes memory besides tiles and labels.
struct Needs {
  ScalarType type;
  std::uint64_t fixed = 0;        ///< bytes
  std::uint64_t brick_bytes = 0;  ///< 0: no bricks are decoded
  std::size_t tile_bricks = 0;    ///< of a tile
  std::uint64_t bricks = 0;       ///< of all tiles
};

int threads_of(const LabelOptions& options) {
  return options.threads > 0 ? options.threads : tbb::info::default_concurrency();
}

LabelPlan divide(const Needs& needs, const LabelOptions& options) {
  LabelPlan plan;
  plan.threads = threads_of(options);
  const std::uint64_t tile_bytes =
      LabelTile::max_bytes(needs.type, label_smoothing(options)) + LabelSpool::max_packed_bytes();
  const std::uint64_t least_bricks = needs.tile_bricks * needs.brick_bytes;
  const std::uint64_t least = needs.fixed + kLeastForLabels + tile_bytes + least_bricks;
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small for labels: at least --memory {}M is needed, "
        "{:.1f} MiB of it for reading on {} threads, {:.1f} for a tile",
        in_mib(options.memory), mib_above(least), in_mib(needs.fixed), plan.threads,
        in_mib(tile_bytes + least_bricks)));
  const std::uint64_t spare = options.memory - least;
  plan.label_bytes = kLeastForLabels + spare / 4;
  plan.tiles = std::clamp<std::size_t>(1 + spare / 4 / tile_bytes, 1,
                                       2 * static_cast<std::size_t>(plan.threads));
  plan.meshes = static_cast<std::size_t>(options.visits > 0 ? options.visits : plan.threads);
  if (needs.brick_bytes == 0) return plan;
  plan.cache_bricks = std::clamp<std::uint64_t>(
      needs.tile_bricks + spare / 2 / needs.brick_bytes, needs.tile_bricks,
      std::max<std::uint64_t>(needs.tile_bricks, 2 * needs.bricks));
  plan.batch_bricks = std::max(needs.tile_bricks, plan.cache_bricks / 2);
  return plan;
}

}  // namespace

LabelSmoothing label_smoothing(const LabelOptions& options) {
  if (options.smooth < 0 || options.smooth > kMaxLabelSmoothing)
    throw UsageError(fmt::format("labels are smoothed by 0 to {} iterations, not {}",
                                 kMaxLabelSmoothing, options.smooth));
  if (!(options.pass_band > 0 && options.pass_band <= 0.8))
    throw UsageError(
        fmt::format("the pass band must be above 0 and at most 0.8, not {}", options.pass_band));
  return {options.smooth, options.pass_band};
}

LabelPlan plan_label_memory(const StoreReader& store, const LabelOptions& options) {
  const LevelInfo& level = store.info().levels[static_cast<std::size_t>(options.level)];
  const Lattice& lattice = level.lattice;
  const int threads = threads_of(options);
  const Index reach = LabelTile::sample_reach(label_smoothing(options));
  const bool searches =
      options.use_lists && !options.labels.empty() && has_index(store, options.level, kLabelIndex);
  return divide(
      {.type = lattice.type,
       .fixed = reading_bytes(level, threads) + decode_extra(store.info(), threads) +
                store.storage()->memory() + (searches ? LabelListSearch::bytes(lattice) : 0),
       .brick_bytes = lattice.brick_bytes(),
       .tile_bricks = max_bricks_of_tile(lattice, reach),
       .bricks = static_cast<std::uint64_t>(volume(lattice.bricks()))},
      options);
}

LabelPlan plan_label_memory(ScalarType type, std::uint64_t source_bytes,
                            const LabelOptions& options) {
  return divide({.type = type, .fixed = source_bytes}, options);
}

}  // namespace isobrick

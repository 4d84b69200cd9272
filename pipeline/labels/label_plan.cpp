#include "pipeline/labels/label_plan.h"

#include <algorithm>

#include <fmt/format.h>
#include <tbb/info.h>

#include <isobrick/error.h>
#include "core/tile.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/labels/label_spool.h"
#include "pipeline/program_memory.h"
#include "surface/labels/label_tile.h"

namespace isobrick::inline v0 {
namespace {

/// For 16,000 labels.
constexpr std::uint64_t kLeastForLabels = std::uint64_t{4} << 20;

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
  const LabelSmoothing smoothing = label_smoothing(options);
  LabelPlan plan;
  plan.threads = options.threads > 0 ? options.threads : tbb::info::default_concurrency();
  const std::size_t tile_bricks = max_bricks_of_tile(lattice, LabelTile::sample_reach(smoothing));
  const std::uint64_t tile_bytes =
      LabelTile::max_bytes(lattice.type, smoothing) + LabelSpool::max_packed_bytes();
  const std::uint64_t fixed = reading_bytes(level, plan.threads) +
                              decode_extra(store.info(), plan.threads) + store.storage()->memory();
  const std::uint64_t least =
      fixed + kLeastForLabels + tile_bytes + tile_bricks * lattice.brick_bytes();
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small for labels: at least --memory {}M is needed, "
        "{:.1f} MiB of it for decoding on {} threads, {:.1f} for a tile",
        in_mib(options.memory), mib_above(least), in_mib(fixed), plan.threads,
        in_mib(tile_bytes + tile_bricks * lattice.brick_bytes())));
  const std::uint64_t spare = options.memory - least;
  plan.label_bytes = kLeastForLabels + spare / 4;
  plan.tiles = std::clamp<std::size_t>(1 + spare / 4 / tile_bytes, 1,
                                       2 * static_cast<std::size_t>(plan.threads));
  plan.meshes = static_cast<std::size_t>(options.visits > 0 ? options.visits : plan.threads);
  const std::uint64_t bricks = static_cast<std::uint64_t>(volume(lattice.bricks()));
  plan.cache_bricks =
      std::clamp<std::uint64_t>(tile_bricks + spare / 2 / lattice.brick_bytes(), tile_bricks,
                                std::max<std::uint64_t>(tile_bricks, 2 * bricks));
  plan.batch_bricks = std::max(tile_bricks, plan.cache_bricks / 2);
  return plan;
}

}  // namespace isobrick

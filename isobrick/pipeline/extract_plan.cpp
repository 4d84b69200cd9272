#include "isobrick/pipeline/extract_plan.h"

#include <fmt/format.h>
#include <tbb/info.h>

#include <algorithm>
#include <cmath>

#include "isobrick/bricks/level_set.h"
#include "isobrick/core/error.h"
#include "isobrick/pipeline/gpu_backend.h"
#include "isobrick/pipeline/program_memory.h"
#include "isobrick/pipeline/resolve_index.h"
#include "isobrick/stream/brick_slots.h"
#include "isobrick/stream/tile_stream.h"

namespace isobrick {
namespace {

/// The ranges of bricks that are compared with decoded ones, and one chunk being read.
constexpr std::uint64_t kRanges = std::uint64_t{6} << 20;
/// A brick being read: its encoded bytes, in the worst case a little more than
/// the decoded ones, and the codec's own window, once a thread.
constexpr std::uint64_t kDecoder = std::uint64_t{2} << 20;

/// The boundaries that wait between finished and unfinished tiles: in Morton order at
/// most about those on the three upper faces of the tile grid.
std::uint64_t boundary_bytes(const Lattice& lattice, bool drop_degenerate) {
  const Int3 t = lattice.tiles();
  const auto faces = static_cast<std::uint64_t>(t.x * t.y + t.y * t.z + t.x * t.z);
  return faces * CpuExtractor::boundary_bytes(drop_degenerate);
}

/// Mesh coordinates are float, and so are the factors of positions and normals.
void check_transform(const StoreInfo& info, const LevelInfo& level) {
  constexpr double least = 1e-30, most = 1e30;
  const auto fits = [](double v, double lo) { return std::abs(v) >= lo && std::abs(v) <= most; };
  const Int3 e = level.lattice.extent;
  const Vec3d far = level.transform.apply(
      {static_cast<double>(e.x), static_cast<double>(e.y), static_cast<double>(e.z)});
  bool fit = true;
  for (int axis = 0; axis < 3; ++axis)
    fit = fit && fits(level.transform.spacing[axis], least) &&
          fits(level.transform.origin[axis], 0) && fits(far[axis], 0);
  if (!fit)
    throw Error(fmt::format(
        "the spacing or origin of '{}' does not fit the 32-bit coordinates of a mesh (1e-30 to "
        "1e30); convert it with another --spacing, --origin or unit",
        info.path.string()));
}

/// What the CUDA driver and its context take of the host's memory.
constexpr std::uint64_t kCudaDriver = std::uint64_t{128} << 20;

/// What every extraction takes besides its surface and its bricks.
std::uint64_t fixed_bytes(const ExtractRequest& request) {
  const Lattice& lattice = request.level->lattice;
  return kProgramBytes + kRanges + request.level->index_bytes + BrickSlots::bytes(lattice) +
         static_cast<std::uint64_t>(request.threads) * (kDecoder + lattice.brick_bytes()) +
         request.search_memory;
}

[[noreturn]] void refuse_budget(const ExtractRequest& request, std::uint64_t budget,
                                std::uint64_t least, std::uint64_t output) {
  const std::uint64_t decoding = fixed_bytes(request) - kProgramBytes;
  throw UsageError(fmt::format(
      "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {:.1f} MiB of "
      "it for the program and its libraries, {:.1f} for decoding on {} threads, {:.1f} for the "
      "output, the rest for bricks and the triangles of a tile",
      in_mib(budget + request.memory_of_others), mib_above(least + request.memory_of_others),
      in_mib(kProgramBytes), in_mib(decoding), request.threads,
      in_mib(output + request.memory_of_others)));
}

/// Bricks that a cache can use: neighbours come on top of the active ones.
std::uint64_t most_useful(std::size_t tile_bricks, std::uint64_t active_bricks) {
  return std::max<std::uint64_t>(tile_bricks, 8 * active_bricks);
}

std::size_t fit_cache(const Lattice& lattice, std::uint64_t bytes, std::size_t tile_bricks,
                      std::uint64_t active_bricks) {
  return static_cast<std::size_t>(std::clamp<std::uint64_t>(
      bytes / lattice.brick_bytes(), tile_bricks, most_useful(tile_bricks, active_bricks)));
}

}  // namespace

ExtractRequest check_request(const StoreReader& store, const ExtractOptions& options,
                             Indexing indexing) {
  const StoreInfo& info = store.info();
  const auto levels = static_cast<int>(info.levels.size());
  if (options.level < 0 || options.level >= levels)
    throw UsageError(fmt::format("level {} does not exist: '{}' has levels 0 to {}", options.level,
                                 info.path.string(), levels - 1));
  if (std::isnan(options.isovalue)) throw UsageError("the isovalue is not a number");
  ExtractRequest request;
  request.level = &info.levels[static_cast<std::size_t>(options.level)];
  check_transform(info, *request.level);
  const Box3 box = request.level->lattice.box();
  const Box3 roi = options.roi.value_or(box);
  if (roi.empty() || intersect(roi, box) != roi)
    throw UsageError(fmt::format(
        "the region {}:{},{}:{},{}:{} is empty or leaves the level's {}×{}×{} samples", roi.lo.x,
        roi.hi.x, roi.lo.y, roi.hi.y, roi.lo.z, roi.hi.z, box.hi.x, box.hi.y, box.hi.z));
  request.surface = {.isovalue = options.isovalue,
                     .inside = options.inside.value_or(inside_of(info)),
                     .normals = options.normals,
                     .indexing = indexing,
                     .drop_degenerate = options.drop_degenerate,
                     .roi = roi,
                     .transform = request.level->transform,
                     .fill_value = info.fill_value,
                     .may_have_nan = info.may_have_nan && is_floating(info.type)};
  request.threads = options.threads > 0 ? options.threads : tbb::info::default_concurrency();
  request.search = resolve_index(store, options.level, options.index);
  request.search_memory = block_search_bytes(store, options.level, request.search, request.threads);
  request.memory_of_others = options.memory_of_others;
  return request;
}

std::uint64_t least_memory(const ExtractRequest& request, std::uint64_t other_bytes) {
  const Lattice& lattice = request.level->lattice;
  const bool drop = request.surface.drop_degenerate;
  return fixed_bytes(request) + boundary_bytes(lattice, drop) + other_bytes +
         CpuExtractor::workspace_bytes(lattice.type, drop) +
         2 * CpuExtractor::max_tile_output(request.surface.normals) +
         max_bricks_of_tile(lattice, sample_reach(request.surface)) * lattice.brick_bytes();
}

ExtractPlan plan_memory(const ExtractRequest& request, std::uint64_t budget,
                        std::uint64_t active_bricks, std::uint64_t other_bytes) {
  const Lattice& lattice = request.level->lattice;
  const bool drop = request.surface.drop_degenerate;
  const std::uint64_t workspace = CpuExtractor::workspace_bytes(lattice.type, drop);
  const std::uint64_t tile_output = CpuExtractor::max_tile_output(request.surface.normals);
  const std::size_t tile_bricks = max_bricks_of_tile(lattice, sample_reach(request.surface));
  const std::uint64_t brick_bytes = lattice.brick_bytes();

  const std::uint64_t fixed = fixed_bytes(request) + boundary_bytes(lattice, drop) + other_bytes;
  const std::uint64_t least = least_memory(request, other_bytes);
  if (budget < least) refuse_budget(request, budget, least, other_bytes);

  ExtractPlan plan;
  const std::uint64_t spare = budget - least;
  plan.limits.tiles = std::clamp<std::size_t>(1 + spare / 6 / workspace, 1,
                                              CpuExtractor::good_batch(request.threads));
  // One piece of mesh is written while the next is made.
  plan.limits.output_bytes = std::clamp<std::uint64_t>(
      tile_output + spare / 12, tile_output, std::max(tile_output, std::uint64_t{32} << 20));
  const std::uint64_t used = fixed + plan.limits.tiles * workspace + 2 * plan.limits.output_bytes;
  plan.cache_bricks = fit_cache(lattice, budget - used, tile_bricks, active_bricks);
  // The next batch is decoded beside the one that is worked on.
  plan.batch_bricks = std::max(tile_bricks, plan.cache_bricks / 2);
  plan.bytes = used + plan.cache_bricks * brick_bytes;
  return plan;
}

ExtractPlan plan_gpu_memory(const ExtractRequest& request, const ExtractOptions& options,
                            std::uint64_t active_bricks, std::uint64_t other_bytes,
                            GpuSession& gpu) {
  const Lattice& lattice = request.level->lattice;
  const std::size_t tile_bricks = max_bricks_of_tile(lattice, sample_reach(request.surface));
  const std::uint64_t brick_bytes = lattice.brick_bytes();
  const std::uint64_t fixed = fixed_bytes(request) + kCudaDriver + other_bytes;
  const std::uint64_t used =
      fixed + gpu.plan(request, options.gpu_memory, options.memory,
                       fixed + tile_bricks * brick_bytes, most_useful(tile_bricks, active_bricks));
  ExtractPlan plan;
  plan.limits.tiles = gpu.good_batch();
  if (const std::size_t pool = gpu.pool_bricks()) {
    plan.cache_bricks = pool;
    plan.batch_bricks = std::max(tile_bricks, pool / 4);
    plan.bytes = used;
    return plan;
  }
  plan.cache_bricks = fit_cache(lattice, options.memory - used, tile_bricks, active_bricks);
  // Two batches are on their way through the GPU while others are decoded.
  plan.batch_bricks = std::max(tile_bricks, plan.cache_bricks / 4);
  plan.bytes = used + plan.cache_bricks * brick_bytes;
  return plan;
}

}  // namespace isobrick

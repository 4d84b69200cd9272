#include "pipeline/extract/extract_plan.h"

#include <fmt/format.h>
#include <tbb/info.h>

#include <algorithm>
#include <cmath>

#include <isobrick/error.h>
#include "bricks/level_set.h"
#include "pipeline/extract/gpu_backend.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/extract/resolve_index.h"
#include "pipeline/program_memory.h"
#include "stream/brick_slots.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {
namespace {

/// The ranges of bricks that are compared with decoded ones, and one chunk being read.
constexpr std::uint64_t kRanges = std::uint64_t{6} << 20;
/// A brick being read: its encoded bytes, in the worst case a little more than
/// the decoded ones, and the codec's own window, once a thread.
constexpr std::uint64_t kDecoder = std::uint64_t{2} << 20;

/// What the options of a pass's surfaces have in common.
const ExtractRequest& common(PassRequests requests) { return requests.front(); }

Topology topology_of(PassRequests requests) { return common(requests).surface.topology; }

bool any_drops(PassRequests requests) {
  return std::any_of(requests.begin(), requests.end(),
                     [](const ExtractRequest& r) { return r.surface.drop_degenerate; });
}

/// The mesh that one tile can make, of the surface that takes most.
std::uint64_t tile_output(PassRequests requests) {
  const bool normals = std::any_of(requests.begin(), requests.end(),
                                   [](const ExtractRequest& r) { return r.surface.normals; });
  return CpuExtractor::max_tile_output(normals, topology_of(requests),
                                       cap_bounds(common(requests).surface));
}

/// The work space for one tile.
std::uint64_t workspace_bytes(PassRequests requests) {
  return CpuExtractor::workspace_bytes(common(requests).level->lattice.type, any_drops(requests),
                                       topology_of(requests), cap_bounds(common(requests).surface));
}

/// The boundaries that wait between finished and unfinished tiles.
std::uint64_t boundary_bytes(PassRequests requests) {
  return requests.size() * CpuExtractor::boundary_bytes(common(requests).level->lattice.tiles(),
                                                        any_drops(requests),
                                                        cap_bounds(common(requests).surface));
}

/// What the CUDA driver and its context take of the host's memory.
constexpr std::uint64_t kCudaDriver = std::uint64_t{128} << 20;

/// Of a tile of the grid where the samples stay on a GPU: three lists and a table.
constexpr std::uint64_t kBytesOfListedTile = 3 * sizeof(TileWork);

/// What every extraction takes besides its surface and its bricks.
std::uint64_t fixed_bytes(const ExtractRequest& request) {
  return reading_bytes(*request.level, request.threads) + request.search_memory;
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

/// Buffers of the files that a sink writes; those of one sink are the program's.
constexpr std::uint64_t kSinkBuffers = std::uint64_t{3} << 20;

std::uint64_t sink_bytes(PassRequests requests) {
  std::uint64_t bytes = (requests.size() - 1) * kSinkBuffers;
  for (const ExtractRequest& request : requests) bytes += request.sink_bytes;
  return bytes;
}

/// Larger chunks of a mesh, or of samples for a GPU, gain nothing.
constexpr std::uint64_t kMaxChunk = std::uint64_t{32} << 20;
/// More files at a time make no disk faster.
constexpr std::size_t kMaxSinks = 8;

/// Bricks that a cache can use: neighbours come on top of the active ones.
std::uint64_t most_useful(std::size_t tile_bricks, PassRequests requests) {
  std::uint64_t active_bricks = 0;
  for (const ExtractRequest& request : requests) active_bricks += request.active_bricks;
  return std::max<std::uint64_t>(tile_bricks, 8 * active_bricks);
}

std::size_t fit_cache(PassRequests requests, std::uint64_t bytes, std::size_t tile_bricks) {
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(bytes / common(requests).level->lattice.brick_bytes(), tile_bricks,
                                most_useful(tile_bricks, requests)));
}

}  // namespace

ExtractRequest check_request(const StoreReader& store, const ExtractOptions& options,
                             Indexing indexing) {
  const StoreInfo& info = store.info();
  const auto levels = static_cast<int>(info.levels.size());
  if (options.level < 0 || options.level >= levels)
    throw UsageError(fmt::format("level {} does not exist: '{}' has levels 0 to {}", options.level,
                                 info.name, levels - 1));
  if (std::isnan(options.isovalue)) throw UsageError("the isovalue is not a number");
  ExtractRequest request;
  request.level = &info.levels[static_cast<std::size_t>(options.level)];
  const Lattice& lattice = request.level->lattice;
  check_coordinates(request.level->transform, lattice.extent, "'" + info.name + "'");
  const Box3 roi = options.roi.value_or(lattice.box());
  check_roi(roi, lattice.extent);
  request.surface = {.isovalue = options.isovalue,
                     .inside = options.inside.value_or(inside_of(info)),
                     .normals = options.normals,
                     .indexing = indexing,
                     .drop_degenerate = options.drop_degenerate,
                     .topology = options.topology,
                     .cap = options.cap,
                     .roi = roi,
                     .transform = request.level->transform,
                     .fill_value = info.fill_value,
                     .may_have_nan = info.may_have_nan && is_floating(info.type)};
  request.packed = store.is_packed(options.level);
  request.threads = options.threads > 0 ? options.threads : tbb::info::default_concurrency();
  request.search = resolve_index(store, options.level, options.index);
  if (options.cap) request.search = {};  // an index finds only what the isovalue touches
  request.search_memory = block_search_bytes(store, options.level, request.search, request.threads);
  request.memory_of_others = options.memory_of_others;
  return request;
}

std::optional<CapSearch> cap_search(const SurfaceOptions& surface) {
  if (!surface.cap) return std::nullopt;
  return CapSearch{surface.inside, surface.roi, surface.may_have_nan};
}

std::vector<double> isovalues_of(PassRequests requests) {
  std::vector<double> isovalues;
  for (const ExtractRequest& request : requests)
    if (std::find(isovalues.begin(), isovalues.end(), request.surface.isovalue) == isovalues.end())
      isovalues.push_back(request.surface.isovalue);
  return isovalues;
}

Index reach_of(PassRequests requests) {
  Index reach = 0;
  for (const ExtractRequest& request : requests)
    reach = std::max(reach, sample_reach(request.surface));
  return reach;
}

std::uint64_t reading_bytes(const LevelInfo& level, int threads) {
  return kProgramBytes + kRanges + level.index_bytes + BrickSlots::bytes(level.lattice) +
         static_cast<std::uint64_t>(threads) * (kDecoder + level.lattice.brick_bytes());
}

std::uint64_t least_memory(PassRequests requests, std::uint64_t other_bytes) {
  const Lattice& lattice = common(requests).level->lattice;
  return fixed_bytes(common(requests)) + boundary_bytes(requests) + sink_bytes(requests) +
         other_bytes + workspace_bytes(requests) + 2 * requests.size() * tile_output(requests) +
         max_bricks_of_tile(lattice, reach_of(requests)) * lattice.brick_bytes();
}

std::size_t surfaces_of_pass(PassRequests requests, std::uint64_t budget,
                             std::uint64_t other_bytes) {
  std::size_t count = 1;
  while (count < requests.size() && least_memory(requests.first(count + 1), other_bytes) <= budget)
    ++count;
  return count;
}

ExtractPlan plan_memory(PassRequests requests, std::uint64_t budget, std::uint64_t other_bytes) {
  const Lattice& lattice = common(requests).level->lattice;
  const std::uint64_t workspace = workspace_bytes(requests);
  const std::size_t tile_bricks = max_bricks_of_tile(lattice, reach_of(requests));
  const std::uint64_t brick_bytes = lattice.brick_bytes();

  const std::uint64_t output = sink_bytes(requests) + other_bytes;
  const std::uint64_t fixed = fixed_bytes(common(requests)) + boundary_bytes(requests) + output;
  const std::uint64_t least = least_memory(requests, other_bytes);
  if (budget < least) refuse_budget(common(requests), budget, least, output);

  ExtractPlan plan;
  const std::uint64_t spare = budget - least;
  plan.limits.tiles = std::clamp<std::size_t>(
      1 + spare / 6 / workspace, 1, CpuExtractor::preferred_batch(common(requests).threads));
  // One piece of each mesh is written while the next is made.
  const std::uint64_t least_output = tile_output(requests);
  plan.limits.output_bytes = std::clamp<std::uint64_t>(
      least_output + spare / 12 / requests.size(), least_output, std::max(least_output, kMaxChunk));
  const std::uint64_t used =
      fixed + plan.limits.tiles * workspace + 2 * requests.size() * plan.limits.output_bytes;
  plan.cache_bricks = fit_cache(requests, budget - used, tile_bricks);
  // The next batch is decoded beside the one that is worked on.
  plan.batch_bricks = std::max(tile_bricks, plan.cache_bricks / 2);
  plan.bytes = used + plan.cache_bricks * brick_bytes;
  return plan;
}

ExtractPlan plan_gpu_memory(PassRequests requests, const ExtractOptions& options,
                            std::uint64_t other_bytes, GpuSession& gpu) {
  const Lattice& lattice = common(requests).level->lattice;
  const std::size_t tile_bricks = max_bricks_of_tile(lattice, reach_of(requests));
  const std::uint64_t brick_bytes = lattice.brick_bytes();
  const std::uint64_t fixed =
      fixed_bytes(common(requests)) + kCudaDriver + sink_bytes(requests) + other_bytes;
  const std::uint64_t used =
      fixed + gpu.plan(requests, options.gpu_memory, options.memory,
                       fixed + tile_bricks * brick_bytes, most_useful(tile_bricks, requests));
  ExtractPlan plan;
  plan.limits.tiles = gpu.preferred_batch();
  if (const std::size_t pool = gpu.pool_bricks()) {
    plan.cache_bricks = pool;
    plan.batch_bricks = std::max(tile_bricks, pool / 4);
    plan.bytes = used;
    return plan;
  }
  plan.cache_bricks = fit_cache(requests, options.memory - used, tile_bricks);
  // Two batches are on their way through the GPU while others are decoded.
  plan.batch_bricks = std::max(tile_bricks, plan.cache_bricks / 4);
  plan.bytes = used + plan.cache_bricks * brick_bytes;
  return plan;
}

std::uint64_t least_resident_memory(PassRequests requests, std::uint64_t other_bytes,
                                    std::size_t sinks) {
  const Lattice& lattice = common(requests).level->lattice;
  std::uint64_t sink = 0;
  for (const ExtractRequest& request : requests) sink = std::max(sink, request.sink_bytes);
  return fixed_bytes(common(requests)) + kCudaDriver + other_bytes + sinks * sink +
         (requests.size() - 1) * kSinkBuffers +
         static_cast<std::uint64_t>(volume(lattice.tiles())) * kBytesOfListedTile +
         2 * kTileVolume * lattice.sample_bytes();
}

std::optional<ExtractPlan> plan_resident_memory(PassRequests requests, std::uint64_t budget,
                                                std::uint64_t other_bytes) {
  const std::uint64_t tile_bytes = kTileVolume * common(requests).level->lattice.sample_bytes();
  ExtractPlan plan;
  plan.sinks = std::min(requests.size(), kMaxSinks);
  const auto least_bytes = [&] { return least_resident_memory(requests, other_bytes, plan.sinks); };
  while (plan.sinks > 1 && budget < least_bytes()) --plan.sinks;
  const std::uint64_t least = least_bytes();
  if (budget < least) return std::nullopt;
  plan.limits.output_bytes =
      std::min(tile_bytes + (budget - least) / 8, std::max(tile_bytes, kMaxChunk));
  plan.limits.tiles = plan.limits.output_bytes / tile_bytes;
  plan.bytes = least + 2 * (plan.limits.output_bytes - tile_bytes);
  return plan;
}

}  // namespace isobrick

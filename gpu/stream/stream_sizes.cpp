#include "gpu/stream/stream_sizes.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>
#include "core/tile.h"
#include "gpu/memory/mesh_arrays.h"
#include "gpu/stream/brick_pool.h"
#include "gpu/stream/stream_layout.h"
#include "gpu/tile/block_groups.h"
#include "gpu/tile/on_samples.h"
#include "surface/cap_bounds.h"
#include "surface/cpu_extractor.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Mesh to expect of a tile before anything is known; launches shrink where there is more.
constexpr std::uint64_t kVerticesOfTile = 1600, kTrianglesOfTile = 3200;
/// What a tile can make at most: 3 edges a sample, what the topology has in a cell, and the cap.
MeshSize max_tile_mesh(const SurfaceOptions& options) {
  const MeshSize of_cell = CpuExtractor::max_in_cell(options.topology);
  const CapBounds cap = cap_bounds(options);
  return {std::uint64_t{3} * 33 * 33 * 33 + of_cell.vertices * kTileBlockSamples + cap.vertices,
          of_cell.triangles * kTileBlockSamples + cap.faces * kMaxFaceTriangles};
}
/// Case table, ends of the numbering, and the rounding of buffers.
constexpr std::uint64_t kSmallBuffers = 64 << 10;
/// Bricks of fewer bytes are not sent: a copy has a price of its own.
constexpr std::uint64_t kMinSentBytes = std::uint64_t{128} << 10;
/// Smaller launches are not worth a pool.
constexpr std::uint64_t kMinTilesWithPool = 128;
/// Bricks a thread that are decoded ahead into a pool, and that are being decoded or belong to
/// launches.
constexpr std::uint64_t kMinAhead = 24, kMaxAhead = 40, kInWork = 8;
/// A row table in the host's bookkeeping: its slot, its tile, its expiry. Tables on the faces of
/// what is finished fill a quarter of their cubes, those of a launch may have a cube each.
constexpr std::uint64_t kBytesOfSlot = 128, kBytesOfCube = 640;

/// Row tables that are needed at a time: as with the CPU's boundaries those on the upper
/// faces of what is finished, and those of the launches in flight.
std::uint64_t slots_for(const Lattice& lattice, bool welded, std::uint64_t tiles, int in_flight) {
  if (!welded) return tiles;
  const Int3 t = lattice.tiles();
  const auto faces = static_cast<std::uint64_t>(t.x * t.y + t.y * t.z + t.x * t.z);
  return std::min(static_cast<std::uint64_t>(volume(t)),
                  faces + (static_cast<std::uint64_t>(in_flight) + 1) * tiles);
}

/// In Morton order about half of the bricks on the three upper faces of the grid live at a time.
std::uint64_t living_bricks(const Lattice& lattice) {
  const Int3 b = lattice.bricks();
  return static_cast<std::uint64_t>(b.x * b.y + b.y * b.z + b.x * b.z) / 2;
}

/// Bricks that hold as many samples as the tiles of a launch and a quarter more, for tiles
/// that do not fill theirs.
std::uint64_t bricks_to_send(const Lattice& lattice, std::uint64_t tiles) {
  if (lattice.brick_bytes() < kMinSentBytes) return 0;
  return tiles * kTileBlockSamples * lattice.sample_bytes() * 5 / 4 / lattice.brick_bytes();
}

std::string too_small(const char* option, std::uint64_t budget, std::uint64_t least) {
  return fmt::format(
      "{} of {} bytes is too small for the GPU: this needs at least {} bytes ({} {}M)", option,
      budget, least, option, (least >> 20) + 1);
}

}  // namespace

std::uint64_t pool_device_bytes(const Lattice& lattice, const PoolSizes& pool) {
  const std::uint64_t bricks = pool.bricks * lattice.brick_bytes();
  return pool.packed && pool.bricks > 0 ? bricks + pool_pinned_bytes(lattice, pool) : bricks;
}

std::uint64_t pool_pinned_bytes(const Lattice& lattice, const PoolSizes& pool) {
  return BrickPool::pinned_bytes(BrickPool::buffer_bytes(lattice, pool.packed), pool.threads,
                                 pool.packed);
}

StreamSizes stream_sizes(const Lattice& lattice, const SurfaceOptions& given, std::uint32_t tiles,
                         int in_flight, PoolSizes pool) {
  const SurfaceOptions options = options_that_matter(lattice.type, given);
  StreamSizes s;
  s.pool = pool;
  const auto in_flight_count = static_cast<std::uint64_t>(in_flight);
  s.tiles = tiles;
  s.in_flight = in_flight;
  const MeshSize most = max_tile_mesh(options);
  s.vertices = std::max(most.vertices, tiles * kVerticesOfTile);
  s.triangles = std::max(most.triangles, tiles * kTrianglesOfTile);
  s.slots = static_cast<std::uint32_t>(
      slots_for(lattice, options.indexing == Indexing::welded, tiles, in_flight));
  s.tile_bricks = static_cast<std::uint32_t>(max_bricks_of_tile(lattice, sample_reach(options)));
  if (pool.bricks == 0) s.sent_bricks = static_cast<std::uint32_t>(bricks_to_send(lattice, tiles));
  const bool on_samples = has_samples(options);
  s.staging_bytes = StagingLayout(tiles, s.tile_bricks, on_samples).end;
  if (on_samples) s.sample_blocks = std::min<std::uint32_t>(tiles, kMaxSampleBlocks);
  const bool trilinear = options.topology == Topology::trilinear;
  if (trilinear) s.trilinear_blocks = std::min<std::uint32_t>(tiles, kMaxTrilinearBlocks);
  s.output_bytes = MeshArrays::bytes(s.vertices, s.triangles, options.normals);
  const std::uint64_t groups = (tiles + kTilesOfBlockGroup - 1) / kTilesOfBlockGroup;
  s.tile_block_bytes = groups * kBlockGroupSamples * lattice.sample_bytes();
  s.device_bytes =
      kSmallBuffers + std::uint64_t{s.slots} * sizeof(RowTable) +
      (on_samples ? std::uint64_t{s.slots} * sizeof(SampleTable) : 0) +
      s.sample_blocks * sizeof(SampleWork) + s.trilinear_blocks * sizeof(TrilinearWork) +
      (trilinear ? sizeof(TopologyTables) : 0) + s.tile_block_bytes +
      pool_device_bytes(lattice, pool) +
      in_flight_count * (s.staging_bytes + s.sent_bricks * lattice.brick_bytes() + s.output_bytes);
  s.pinned_bytes = kSmallBuffers + in_flight_count * s.staging_bytes + kOutputs * s.output_bytes +
                   pool_pinned_bytes(lattice, pool);
  s.host_bytes = kBytesOfSlot * s.slots + (in_flight_count + 1) * tiles * kBytesOfCube +
                 in_flight_count * tiles * sizeof(OrderState);
  return s;
}

std::vector<std::size_t> output_chunks(const StreamSizes& sizes) {
  return std::vector<std::size_t>(kOutputs, sizes.output_bytes);
}

std::uint64_t preferred_pool_bricks(const Lattice& lattice, int threads) {
  return std::min(
      static_cast<std::uint64_t>(volume(lattice.bricks())),
      living_bricks(lattice) + (kMaxAhead + kInWork) * static_cast<std::uint64_t>(threads));
}

std::size_t bricks_ahead(const Lattice& lattice, const PoolSizes& pool) {
  const std::uint64_t others =
      living_bricks(lattice) + kInWork * static_cast<std::uint64_t>(pool.threads);
  return static_cast<std::size_t>(std::clamp(
      (pool.bricks - std::min(pool.bricks, others)) / static_cast<std::uint64_t>(pool.threads),
      kMinAhead, kMaxAhead));
}

std::uint64_t device_bytes_of(const Lattice& lattice, std::span<const StreamSizes> sizes) {
  const std::uint64_t pool = pool_device_bytes(lattice, sizes.front().pool);
  std::uint64_t bytes = pool;
  for (const StreamSizes& s : sizes) bytes += s.device_bytes - pool;
  return bytes;
}

std::uint64_t host_bytes_of(const Lattice& lattice, std::span<const StreamSizes> sizes) {
  const std::uint64_t pool = pool_pinned_bytes(lattice, sizes.front().pool);
  std::uint64_t bytes = pool;
  for (const StreamSizes& s : sizes) bytes += s.pinned_bytes - pool + s.host_bytes;
  return bytes;
}

namespace {

std::vector<StreamSizes> sizes_of_each(const Lattice& lattice,
                                       std::span<const SurfaceOptions> surfaces,
                                       std::uint32_t tiles, int in_flight, PoolSizes pool = {}) {
  std::vector<StreamSizes> sizes;
  for (const SurfaceOptions& options : surfaces)
    sizes.push_back(stream_sizes(lattice, options, tiles, in_flight, pool));
  return sizes;
}

/// Launches beside a pool of at least 60 % of what is wanted; none where they don't fit.
std::vector<StreamSizes> fit_pool(const Lattice& lattice, std::span<const SurfaceOptions> surfaces,
                                  std::uint64_t device_budget, std::uint64_t host_budget,
                                  std::uint64_t other_host_bytes, PoolSizes wanted) {
  if (wanted.bricks == 0 || lattice.brick_bytes() < kMinSentBytes) return {};
  const auto all = static_cast<std::uint64_t>(volume(lattice.tiles()));
  for (std::uint64_t tiles = std::min<std::uint64_t>(kMaxTilesOfLaunch, all);
       tiles >= std::min<std::uint64_t>(kMinTilesWithPool, all); tiles /= 2)
    for (int in_flight = kMaxInFlight; in_flight >= kMinInFlight; --in_flight) {
      PoolSizes pool{1, wanted.threads, wanted.packed};
      const auto count = static_cast<std::uint32_t>(tiles);
      const std::uint64_t launches =
          device_bytes_of(lattice, sizes_of_each(lattice, surfaces, count, in_flight, pool));
      if (launches > device_budget) continue;
      pool.bricks = std::min(wanted.bricks, 1 + (device_budget - launches) / lattice.brick_bytes());
      if (10 * pool.bricks < 6 * wanted.bricks) continue;
      const auto sizes = sizes_of_each(lattice, surfaces, count, in_flight, pool);
      // Any tile's bricks must fit, however few bricks there are.
      if (std::any_of(sizes.begin(), sizes.end(),
                      [&](const StreamSizes& s) { return pool.bricks < s.tile_bricks; }))
        continue;
      if (host_bytes_of(lattice, sizes) + other_host_bytes <= host_budget) return sizes;
    }
  return {};
}

}  // namespace

std::vector<StreamSizes> fit_stream_sizes(const Lattice& lattice,
                                          std::span<const SurfaceOptions> surfaces,
                                          std::uint64_t device_budget, std::uint64_t host_budget,
                                          std::uint64_t other_host_bytes, PoolSizes wanted) {
  if (auto sizes =
          fit_pool(lattice, surfaces, device_budget, host_budget, other_host_bytes, wanted);
      !sizes.empty())
    return sizes;
  const auto all = static_cast<std::uint64_t>(volume(lattice.tiles()));
  auto tiles = static_cast<std::uint32_t>(std::min<std::uint64_t>(kMaxTilesOfLaunch, all));
  for (int in_flight = kMaxInFlight;; --in_flight) {
    if (in_flight < kMinInFlight) {
      in_flight = kMaxInFlight;
      tiles /= 2;
    }
    auto sizes = sizes_of_each(lattice, surfaces, tiles, in_flight);
    const std::uint64_t device = device_bytes_of(lattice, sizes),
                        own = host_bytes_of(lattice, sizes), host = own + other_host_bytes;
    const bool least = tiles == 1 && in_flight == kMinInFlight;
    // But for the least they leave half to the bricks.
    const std::uint64_t needed = least ? host : host + own;
    if (device <= device_budget && needed <= host_budget) return sizes;
    if (!least) continue;
    if (device > device_budget) throw UsageError(too_small("--gpu-memory", device_budget, device));
    throw UsageError(too_small("--memory", host_budget, host));
  }
}

StreamSizes fit_stream_sizes(const Lattice& lattice, const SurfaceOptions& options,
                             std::uint64_t device_budget, std::uint64_t host_budget,
                             std::uint64_t other_host_bytes, PoolSizes wanted) {
  return fit_stream_sizes(lattice, std::span(&options, 1), device_budget, host_budget,
                          other_host_bytes, wanted)
      .front();
}

}  // namespace isobrick::gpu

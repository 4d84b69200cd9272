#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/surface_options.h>

namespace isobrick::inline v0::gpu {

/// A pool of bricks on the device (brick_pool.h), filled by so many threads.
struct PoolSizes {
  std::uint64_t bricks = 0;  ///< 0: there is none, the device reads bricks in host memory
  int threads = 0;
  bool packed = false;  ///< bricks come packed, and the device decodes them
};

/// Device memory of a pool, and page-locked host memory.
std::uint64_t pool_device_bytes(const Lattice& lattice, const PoolSizes& pool);
std::uint64_t pool_pinned_bytes(const Lattice& lattice, const PoolSizes& pool);

/// How large the buffers of a streaming extraction are.
struct StreamSizes {
  PoolSizes pool;
  std::uint32_t tiles = 0;                    ///< a launch takes at most
  int in_flight = 0;                          ///< launches at a time
  std::uint64_t vertices = 0, triangles = 0;  ///< that the output of a launch has room for
  std::uint32_t slots = 0;                    ///< row tables
  std::uint32_t sample_blocks = 0;            ///< of threads that make vertices on samples
  std::uint32_t trilinear_blocks = 0;         ///< of threads, that follow the interpolant
  std::uint32_t tile_bricks = 0;              ///< bricks that a tile's samples can lie in
  std::uint32_t sent_bricks = 0;              ///< that a launch can take along whole
  std::uint64_t staging_bytes = 0;            ///< all else that the host sends for a launch
  std::uint64_t output_bytes = 0;             ///< mesh of a launch
  std::uint64_t tile_block_bytes = 0;         ///< samples of a launch as the kernel reads them
  std::uint64_t device_bytes = 0;             ///< device memory, all in all
  std::uint64_t pinned_bytes = 0;             ///< pinned host memory, all in all
  std::uint64_t host_bytes = 0;               ///< other host memory
};

/// Launches in flight at a time: one is uploaded while the one before is
/// extracted or downloaded. More hide how long busy cores take to notice that one is over.
inline constexpr int kMinInFlight = 2, kMaxInFlight = 4;
/// Meshes in host memory at a time: one is downloaded, one written, one waits.
inline constexpr int kOutputs = 3;
/// More tiles a launch gain little, for a device is faster than what feeds it, and cost
/// pinned memory, which takes long to get.
inline constexpr std::uint32_t kMaxTilesOfLaunch = 256;

/// The sizes for launches of `tiles` tiles.
StreamSizes stream_sizes(const Lattice& lattice, const SurfaceOptions& options, std::uint32_t tiles,
                         int in_flight = kMinInFlight, PoolSizes pool = {});

/// The chunks of pinned memory that meshes are downloaded to.
std::vector<std::size_t> output_chunks(const StreamSizes& sizes);

/// Bricks that a pool should have room for when so many threads decode for launches of a
/// whole volume.
std::uint64_t preferred_pool_bricks(const Lattice& lattice, int threads);

/// Bricks a thread that should be decoded ahead into such a pool: what waits for a thread that
/// was held up takes no host memory here.
std::size_t bricks_ahead(const Lattice& lattice, const PoolSizes& pool);

/// The largest launches within both budgets, of the host's `other_host_bytes` being taken.
/// With a pool of `wanted.bricks` where the device has room for most of it; else they leave
/// half of the rest of the host's memory, for bricks. Throws UsageError naming the least
/// `--gpu-memory` or `--memory` that works.
StreamSizes fit_stream_sizes(const Lattice& lattice, const SurfaceOptions& options,
                             std::uint64_t device_budget, std::uint64_t host_budget,
                             std::uint64_t other_host_bytes, PoolSizes wanted = {});

/// The same for extractions of several surfaces beside each other, which share the pool: the sizes
/// of each, with launches of as many tiles.
std::vector<StreamSizes> fit_stream_sizes(const Lattice& lattice,
                                          std::span<const SurfaceOptions> surfaces,
                                          std::uint64_t device_budget, std::uint64_t host_budget,
                                          std::uint64_t other_host_bytes, PoolSizes wanted = {});

/// Device memory of such extractions, their pool counted once.
std::uint64_t device_bytes_of(const Lattice& lattice, std::span<const StreamSizes> sizes);
/// Their host memory, pinned and other.
std::uint64_t host_bytes_of(const Lattice& lattice, std::span<const StreamSizes> sizes);

}  // namespace isobrick::gpu

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include <isobrick/surface_options.h>
#include "core/tile.h"
#include "gpu/stream/stream_sizes.h"

namespace isobrick::gpu {

class BrickPool;

/// Takes a chunk of the mesh. It stays valid until `release` is called, once, from any
/// thread. When it throws, it has not taken the chunk.
using TakeChunk = std::function<void(const MeshChunk& chunk, std::function<void()> release)>;

/// How long a stage was busy, and with how much.
struct StreamStage {
  double seconds = 0;
  std::uint64_t bytes = 0;
};

/// What a streaming extraction did.
struct StreamReport {
  std::uint64_t vertices = 0, triangles = 0;
  /// gather: kernels that lay samples out, and what they read in the pool or in host memory.
  StreamStage upload, gather, kernel, download;
  std::uint64_t launches = 0, repeats = 0;  ///< repeats: parts of launches whose mesh was too large
  std::uint32_t tiles_of_launch = 0;        ///< at most
  std::uint64_t device_bytes = 0;           ///< device memory held
  std::uint64_t pinned_bytes = 0;           ///< block-locked host memory held
};

/// Marching cubes on a device, for volumes that need not fit it: tiles in, the CPU's mesh
/// out, byte for byte. Upload, kernels, download and whoever takes the mesh work at the same
/// time, on some hundred tiles each. docs/design/gpu.md describes it.
class GpuExtractor {
 public:
  /// Buffers of the given sizes on the device, which open_device has made ready; of smaller
  /// launches where the device has no room for them. `take` is called from a thread of
  /// the extractor's own. Throws UsageError for what has no kernels (supported.h), an
  /// isovalue that is not a number or an empty region, Error where a single tile does not fit.
  /// Sizes with a pool of bricks are for that pool.
  GpuExtractor(int device, const Lattice& lattice, const SurfaceOptions& options,
               const StreamSizes& sizes, TakeChunk take,
               const std::shared_ptr<BrickPool>& pool = nullptr);
  /// Stops; waits for chunks that were taken and not released.
  ~GpuExtractor();

  /// Sends the tiles off. Over all calls tiles come in Morton order, none twice; `bricks`
  /// holds those of for_each_needed_box (of whole tiles where there may be NaN), in the pool or in
  /// memory from host_memory(). It is not looked up any more afterwards, but its samples are read
  /// until `samples` is let go. Throws what went wrong on the device or in `take`, also of earlier
  /// tiles, and Error when a welded mesh gets more vertices than 32 bits number.
  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
               const std::shared_ptr<const void>& samples);
  /// Waits until all of the mesh was taken.
  void finish();

  /// Whole after finish().
  StreamReport report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

#pragma once

#include <memory>
#include <span>

#include "gpu/stream/stream_sizes.h"
#include "surface/surface_extractor.h"
#include "surface/tile_places.h"

namespace isobrick::inline v0::gpu {

class BrickPool;

/// Marching cubes on a device, for volumes that need not fit it: the CPU's mesh, byte for byte.
/// Upload, kernels, download and the sink work at the same time, on some hundred tiles each.
/// docs/design/gpu.md describes it.
class GpuExtractor final : public SurfaceExtractor {
 public:
  /// Buffers of the given sizes on the device, which open_device has made ready; of smaller
  /// launches where the device has no room for them. The sink must outlive it. Throws UsageError
  /// for an isovalue that is not a number or an empty region, Error where a single tile does not
  /// fit. Sizes with a pool of bricks are for that pool.
  GpuExtractor(int device, const Lattice& lattice, const SurfaceOptions& options,
               const StreamSizes& sizes, MeshSink& sink,
               const std::shared_ptr<BrickPool>& pool = nullptr);
  /// Stops; chunks that the sink has not begun to take are dropped unless finish() was called.
  ~GpuExtractor() override;

  /// As CpuExtractor::make_part().
  void make_part(const TileRange& part, TilePlaces& places);

  /// Sends the tiles off. `bricks` lie in the pool or in memory from host_memory(). Throws also
  /// what went wrong on the device.
  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
               const std::shared_ptr<const void>& samples) override;
  void finish() override;
  SurfaceReport report() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

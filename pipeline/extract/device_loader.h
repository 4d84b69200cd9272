#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/device_volume.h>
#include <isobrick/extract.h>
#include "gpu/resident/resident_sizes.h"
#include "gpu/stream/stream_sizes.h"
#include "pipeline/extract/extract_plan.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {

/// The tiles of a level that surfaces look at.
struct SurfaceTiles {
  std::vector<Int3> searched, loaded;  ///< gpu::DeviceTiles
  std::uint64_t active = 0;            ///< of the isovalue that has most

  gpu::ResidentTiles count() const { return {searched.size(), loaded.size(), active}; }
};

/// Those of a stream; `reach` as gpu::tiles_to_load(). None where there are more than `max_tiles`.
std::optional<SurfaceTiles> find_surface_tiles(TileStream& stream, const Lattice& lattice,
                                               Index reach, std::uint64_t max_tiles);

/// Reads tiles of a level to a device. Packed bricks are decoded there.
class DeviceLoader {
 public:
  /// `store` must outlive it.
  DeviceLoader(const StoreReader& store, int level, const ExtractRequest& request, int device);

  /// Page-locked host memory and device memory that it takes while it loads.
  std::uint64_t pinned_bytes() const;
  std::uint64_t device_bytes() const;

  /// Loads all tiles that `volume` has room for, at most `tiles_at_once` at a time, and waits.
  /// Calls `done` with how many have been begun so far. Throws the errors of reading and decoding,
  /// and OutOfDeviceMemory.
  void load(gpu::DeviceVolume& volume, std::span<const Int3> tiles, std::size_t tiles_at_once,
            const std::function<void(std::size_t)>& done);

  /// Of the last load(): bricks that were read, how often, and seconds of waiting for them.
  std::uint64_t bricks_read() const { return bricks_read_; }
  std::uint64_t reads() const { return reads_; }
  double wait_seconds() const { return wait_seconds_; }
  const StageReport& upload() const { return upload_; }

 private:
  const StoreReader& store_;
  int level_;
  Lattice lattice_;
  int device_;
  gpu::PoolSizes pool_;
  std::uint64_t bricks_read_ = 0, reads_ = 0;
  double wait_seconds_ = 0;
  StageReport upload_;
};

}  // namespace isobrick

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "isobrick/core/lattice.h"
#include "isobrick/gpu/device.h"
#include "isobrick/surface/surface_options.h"

namespace isobrick::gpu {

/// A whole volume in device memory, at its own width, as pages of one tile each,
/// with the ranges of all tiles. Not thread-safe.
class DeviceVolume {
 public:
  /// Copies the volume to the current device. `bricks` must hold every brick that
  /// is not absent. Throws UsageError for a type that has no kernels, Error when
  /// the device runs out of memory.
  DeviceVolume(const Lattice& lattice, const BrickLookup& bricks, double fill_value);
  ~DeviceVolume();

  const Lattice& lattice() const;
  /// Bytes of device memory that it holds.
  std::uint64_t bytes() const;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// How the active tiles of a volume are found.
enum class TileSearch : std::uint8_t {
  ranges,  ///< compares the range of every tile
  interval,
  kdtree,
  quadtree,
  octree,  ///< through that structure over the tiles; up to 1,024 of them the host searches it
  none     ///< takes every tile: brute force
};

/// How a resident volume is extracted; none of it shows in the mesh.
struct ResidentTuning {
  TileSearch search = TileSearch::ranges;
  /// Threads that share a tile: 0 chooses, 384, 640 and 1024 always work, 32, 64,
  /// 128, 256 and 512 for u8 without normals.
  int threads = 0;
  /// Of small volumes (up to 128 tiles of 32³, without NaN) an extraction stays on the device for
  /// so long, for the next isovalue, where the last ones came sooner than that after each other,
  /// and `threads` is 0. Other work may have to wait for a millisecond or three times as long as
  /// this. 0: it does not stay.
  std::chrono::nanoseconds patience = std::chrono::microseconds(20);
};

/// What an extraction on the device made.
struct DeviceCounts {
  std::uint64_t vertices = 0, triangles = 0;
  std::uint32_t active_tiles = 0;
};

/// Isosurfaces of a resident volume: search and extraction without leaving the
/// device. Keeps its buffers from isovalue to isovalue. Those of one volume are for one thread at a
/// time.
class ResidentExtractor {
 public:
  /// The isovalue of `options` does not matter. Throws UsageError for what the
  /// device cannot do yet: dropping degenerate triangles, meshes that are not welded;
  /// and for threads that have no kernels.
  ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                    const ResidentTuning& tuning = {});
  ~ResidentExtractor();

  /// The mesh of `isovalue`, in device memory until the next call. Grows the
  /// buffers and repeats when it does not fit them.
  DeviceCounts extract(double isovalue);
  /// Makes the last mesh once more, without waiting for it; for measuring, after an extract().
  /// `queued`: once the stream has nothing to do, and it begins only when all of it is there, as
  /// where launches follow one another.
  void repeat(bool queued = false);
  /// Milliseconds of the last repeat() on the stream, with the searches that it makes: the host
  /// searches up to 4,096 tiles by their ranges, 1,024 through an index. What the host does before
  /// it has launched is part of it, but not of one that was queued.
  float milliseconds();

  /// Copies the last mesh to the host.
  void download(MeshBuffer& mesh) const;
  /// How many isovalues have been asked of an extraction that had stayed, which spares a launch.
  std::uint64_t asked() const;
  /// Bytes of device memory besides the volume's.
  std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

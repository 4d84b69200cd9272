#pragma once

#include <cstdint>
#include <memory>

#include <isobrick/device.h>
#include <isobrick/lattice.h>
#include <isobrick/surface_options.h>

namespace isobrick::gpu {

/// A whole volume in device memory, at its own width, as tile_blocks of one tile each,
/// with the ranges of all tiles. Not thread-safe.
class DeviceVolume {
 public:
  /// Copies the volume to the current device. `bricks` must hold every brick that
  /// is not absent. Throws UsageError for a type that has no kernels, Error when
  /// the device runs out of memory.
  DeviceVolume(const Lattice& lattice, const BrickLookup& bricks, double fill_value);
  ~DeviceVolume();

  /// The samples and how they lie.
  const Lattice& lattice() const;
  /// Bytes of device memory that it holds.
  std::uint64_t bytes() const;

  struct Impl;  ///< private to the library
  /// For the library itself.
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

struct LaunchShape;

/// How a resident volume is extracted; none of it shows in the mesh. For measuring.
struct ResidentTuning {
  bool brute_force = false;  ///< takes every tile instead of comparing ranges
  /// The thread blocks to use (tile_kernel.h), for all calls; null: those that fit the tiles.
  const LaunchShape* shape = nullptr;
};

/// What an extraction on the device made.
struct DeviceCounts {
  std::uint64_t vertices = 0;      ///< of the mesh
  std::uint64_t triangles = 0;     ///< of the mesh
  std::uint32_t active_tiles = 0;  ///< tiles that the surface passes through
};

/// Isosurfaces of a resident volume: search and extraction without leaving the
/// device. Keeps its buffers from isovalue to isovalue. Those of one volume are for one thread at a
/// time.
class ResidentExtractor {
 public:
  /// The isovalue of `options` does not matter. Throws UsageError for what the
  /// device cannot do yet: dropping degenerate triangles, meshes that are not welded.
  ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                    const ResidentTuning& tuning = {});
  ~ResidentExtractor();

  /// The mesh of `isovalue`, in device memory until the next call. Grows the
  /// buffers and repeats when it does not fit them.
  DeviceCounts extract(double isovalue);
  /// Makes the last mesh once more, without waiting for it; for measuring, after an extract().
  void repeat();
  /// Milliseconds of the last repeat() on the stream, the search included; waits for it.
  float milliseconds();

  /// Copies the last mesh to the host.
  void download(MeshBuffer& mesh) const;
  /// Bytes of device memory besides the volume's.
  std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

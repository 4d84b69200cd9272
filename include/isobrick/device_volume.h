#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/device.h>
#include <isobrick/device_array.h>
#include <isobrick/device_mesh.h>
#include <isobrick/lattice.h>
#include <isobrick/surface_options.h>
#include <isobrick/surface_report.h>

namespace isobrick::inline v0::gpu {

/// Tiles of 32³ cells of a volume, by their place in units of 32 samples.
struct DeviceTiles {
  std::span<const Int3> searched;  ///< where a surface may be, in Morton order
  std::span<const Int3> loaded;    ///< whose 32³ samples those look at (tiles_to_load)
};

/// A volume in device memory, at its own width, as blocks of one tile each, with the ranges of the
/// tiles. Not thread-safe.
class ISOBRICK_API DeviceVolume {
 public:
  /// Copies the whole volume to the current device. `bricks` must hold every brick that
  /// is not absent. Throws UsageError for a type that has no kernels, OutOfDeviceMemory when
  /// the device has too little.
  DeviceVolume(const Lattice& lattice, const BrickLookup& bricks, double fill_value);
  /// Room for the loaded tiles, which a loader within the library fills before the first
  /// extraction (gpu/resident/tile_loader.h). Without a target the volume has a stream of its own.
  /// Throws as above.
  DeviceVolume(const Lattice& lattice, double fill_value, const DeviceTiles& tiles,
               const DeviceTarget* target = nullptr);
  /// Of an array of the current device, which must stay as it is: extractors copy the tiles that
  /// surfaces look at. Finds the ranges of all tiles and waits for them. Strides are given,
  /// multiples of a sample.
  explicit DeviceVolume(const DeviceArray& array);
  ~DeviceVolume();

  /// The samples and how they lie.
  const Lattice& lattice() const;
  /// Whether a sample of an array is NaN; not known of bricks.
  bool has_nan() const;
  /// Bytes of device memory that it holds; the copied tiles of an array are its extractors'.
  std::uint64_t bytes() const;

  struct Impl;  ///< private to the library
  /// For the library itself.
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// The tiles that surfaces in `searched` look at, in Morton order. `reach` is 1 with normals,
/// where samples may be NaN or where degenerate triangles are left out, else 0.
ISOBRICK_API std::vector<Int3> tiles_to_load(const Lattice& lattice, std::span<const Int3> searched,
                                             Index reach);

struct LaunchShape;

/// How a resident volume is extracted; none of it shows in the mesh. For measuring.
struct ResidentTuning {
  bool brute_force = false;  ///< takes every tile instead of comparing ranges
  /// The thread blocks to use (tile_kernel.h), for all calls; null: those that fit the tiles.
  const LaunchShape* shape = nullptr;
};

/// What an extraction on the device made.
struct DeviceCounts {
  std::uint64_t vertices = 0;              ///< of the mesh
  std::uint64_t triangles = 0;             ///< of the mesh
  std::uint32_t active_tiles = 0;          ///< tiles that the surface passes through
  std::uint64_t degenerate_triangles = 0;  ///< left out, with SurfaceOptions::drop_degenerate
};

/// Isosurfaces of a resident volume: search and extraction without leaving the
/// device. Keeps its buffers from isovalue to isovalue. Those of one volume are for one thread at a
/// time, but for write().
class ISOBRICK_API ResidentExtractor {
 public:
  /// The isovalue of `options` does not matter. Takes at most `max_bytes` of device memory besides
  /// the volume's. Throws UsageError for meshes that are not welded; OutOfDeviceMemory.
  ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                    const ResidentTuning& tuning = {}, std::uint64_t max_bytes = ~std::uint64_t{0});
  ~ResidentExtractor();

  /// The mesh of `isovalue`, in device memory until the next call. Grows the
  /// buffers and repeats when it does not fit them. OutOfDeviceMemory where it cannot.
  DeviceCounts extract(double isovalue);
  /// The two halves of extract(): begin() waits for nothing, finish() for the size of the mesh.
  void begin(double isovalue);
  bool is_over() const;   ///< whether finish() has nothing to wait for
  DeviceCounts finish();  ///< of the last begin()
  /// The last mesh, with its memory; `unit` is that of its positions. The extractor takes as much
  /// anew for the next one.
  DeviceMesh take_mesh(const std::string& unit);
  /// Makes the last mesh once more, without waiting for it; for measuring, after an extract().
  void repeat();
  /// Milliseconds of the last repeat() on the stream, the search included; waits for it.
  float milliseconds();

  /// Copies the last mesh to the host.
  void download(Mesh& mesh) const;
  /// Takes the pinned memory that write() needs, twice `chunk_bytes`. Throws Error where there is
  /// none, UsageError for less than 24 bytes.
  void reserve_chunks(std::size_t chunk_bytes);
  /// Passes the last mesh to a sink that has begun, and does not finish it. Positions and normals
  /// come before triangles, in chunks of at most `chunk_bytes`. Reserves them where that is not
  /// done. May run beside write() of other extractors, on any thread.
  void write(MeshSink& sink, std::size_t chunk_bytes);
  /// Of the last mesh: its size, the stages kernel, download and sink, device memory without the
  /// volume's.
  SurfaceReport report() const;
  /// Bytes of device memory besides the volume's.
  std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

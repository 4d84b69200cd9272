#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include <isobrick/surface_options.h>
#include "gpu/memory/mesh_arrays.h"
#include "surface/grid_view.h"

namespace isobrick::inline v0::gpu {

/// Device memory for a grid's mesh, and how much there is.
struct GridMeshPlace {
  MeshArrays arrays;
  std::uint32_t vertices = 0, triangles = 0;

  bool holds(std::uint32_t v, std::uint32_t t) const { return v <= vertices && t <= triangles; }
};

/// How large a grid's mesh is, seam strips included.
struct GridMeshSize {
  std::uint32_t vertices = 0, triangles = 0, seam_triangles = 0;
};

/// A grid in a slot, and where its mesh goes.
struct GridMeshJob {
  int slot = 0;
  GridMeshPlace place;  ///< may hold nothing
};

/// Marching cubes over small grids on a device, several at a time: the meshes of the CPU's
/// GridExtractor, byte for byte. Slots keep grids; each takes 8 MiB of work space on the device
/// and 3 MiB of pinned memory. All but stage() is for one thread at a time.
class GridBatch {
 public:
  /// On a device that open_device has made ready, whose code is loaded here. Throws Error when
  /// memory is short.
  GridBatch(int device, int slots);
  ~GridBatch();

  /// Copies a grid into a slot; from any thread, while nothing else is done with the slot. The
  /// view's arrays are not read any more afterwards.
  void stage(int slot, const GridView& grid);

  /// Finds the sizes of the meshes of staged grids and writes those that their places hold;
  /// waits once, awake for a millisecond and then asleep.
  void make(std::span<const GridMeshJob> jobs);
  /// Of a grid made last; valid until the slot is staged again.
  GridMeshSize size(int slot) const;
  /// Writes the meshes of grids made last to places that hold them; waits once.
  void write(std::span<const GridMeshJob> jobs);
  /// The same for one, into host memory.
  void download(int slot, Mesh& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

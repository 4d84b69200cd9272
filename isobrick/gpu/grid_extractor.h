#pragma once

#include <cstdint>
#include <memory>

#include "isobrick/surface/grid_view.h"
#include "isobrick/surface/surface_options.h"

namespace isobrick::gpu {

/// Device memory for a grid's mesh, and how much there is.
struct GridMeshPlace {
  Vec3f *positions = nullptr, *normals = nullptr;
  Triangle* triangles = nullptr;
  std::uint32_t vertices = 0, triangle_count = 0;

  bool holds(std::uint32_t v, std::uint32_t t) const {
    return v <= vertices && t <= triangle_count;
  }
};

/// Marching cubes over one small grid on a device: the mesh of the CPU's GridExtractor, byte
/// for byte. One for each thread, which makes it: keeps a stream, work space on the device
/// (8 MiB) and page-locked memory (3 MiB).
class GridExtractor {
 public:
  /// On a device that open_device has made ready. Throws Error when memory is short.
  explicit GridExtractor(int device);
  ~GridExtractor();

  /// Ribbons included.
  struct Size {
    std::uint32_t vertices = 0, triangles = 0, ribbon_triangles = 0;
  };
  /// Takes the grid to the device, finds the size of its mesh and, where `place` holds it,
  /// writes it there; waits once. The view's arrays lie in host memory and are not read any
  /// more afterwards.
  Size make(const GridView& grid, const GridMeshPlace& place);
  /// Writes the mesh of the grid made last to a place that holds it.
  void write(const GridMeshPlace& place);
  /// The same, into host memory.
  void download(MeshBuffer& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

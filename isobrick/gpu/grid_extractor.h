#pragma once

#include <cstdint>
#include <memory>

#include "isobrick/surface/grid_view.h"
#include "isobrick/surface/surface_options.h"

namespace isobrick::gpu {

/// Device memory for a grid's mesh.
struct GridMeshPlace {
  Vec3f *positions = nullptr, *normals = nullptr;
  Triangle* triangles = nullptr;
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
  /// Takes the grid to the device and finds the size of its mesh. The view's arrays lie in
  /// host memory and are not read any more afterwards.
  Size count(const GridView& grid);
  /// Writes the mesh of the grid counted last, and waits for it.
  void write(const GridMeshPlace& place);
  /// The same, into host memory.
  void download(MeshBuffer& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu

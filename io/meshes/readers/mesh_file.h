#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <isobrick/mesh.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The description of a mesh file.
struct MeshFileInfo {
  /// Faces of PLY may have more than three corners: several triangles each.
  std::uint64_t vertices = 0, faces = 0;
  std::string unit = {};  ///< of its coordinates, as unit_name() has it; empty: it has none
};

/// A mesh file that is read in batches. It is mapped, not loaded (what is text, base64 or packed
/// goes through a nameless file): memory is that of a batch. One thread at a time.
class MeshFile {
 public:
  virtual ~MeshFile() = default;

  /// A batch; its triangles count from its first vertex, its coordinates from `origin`. Normals
  /// are of any length. Colours come where the file has them at its vertices.
  using Take = std::function<void(const MeshChunk&, Vec3d origin)>;

  virtual MeshFileInfo info() const = 0;
  /// Bounds of all vertices; looks at each. Empty files: two equal corners. Throws
  /// Error for a coordinate that is not finite.
  virtual void bounds(Vec3d& lo, Vec3d& hi) const = 0;
  /// Gives out every triangle, as coordinates relative to `origin`. Throws Error for one that
  /// names a vertex that is not there.
  virtual void read(Vec3d origin, const Take& take) const = 0;

  static constexpr std::size_t kBatch = std::size_t{1} << 16;  ///< triangles
};

/// Opens a PLY, STL, OBJ, GLB, glTF or VTK PolyData file (.vtp, .pvtp).
/// Throws Error for one that is damaged or has what is not read here.
std::unique_ptr<MeshFile> open_mesh_file(const std::string& path);

}  // namespace isobrick

#pragma once

#include <memory>
#include <span>

#include <isobrick/surface_options.h>
#include <isobrick/surface_report.h>
#include "core/tile.h"

namespace isobrick::inline v0 {

/// How many layers of samples around its cells a tile needs: one for gradients
/// and for looking at the neighbours of NaN and of samples that equal the
/// isovalue, none otherwise.
inline Index sample_reach(const SurfaceOptions& options) {
  return options.normals || options.may_have_nan || options.drop_degenerate ? 1 : 0;
}

/// Bytes of a mesh in memory.
constexpr std::uint64_t mesh_bytes(MeshSize size, bool normals) {
  return size.vertices * sizeof(Vec3f) * (normals ? 2 : 1) + size.triangles * sizeof(Triangle);
}

/// Marching cubes on whatever backend: tiles in, a mesh to a sink. The mesh is a pure function of
/// samples and options, in Morton order of tiles.
class SurfaceExtractor {
 public:
  virtual ~SurfaceExtractor() = default;

  /// Over all calls, tiles come in Morton order, none twice; `bricks` holds those of
  /// for_each_needed_box (of whole tiles where there may be NaN). It is not looked up any more
  /// afterwards, but its samples may be read until `samples`, which owns them, is let go. Called in
  /// the TBB arena that does the work. Throws what the sink threw, also of earlier tiles, and Error
  /// when a welded mesh gets more vertices than 32 bits number.
  virtual void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
                       const std::shared_ptr<const void>& samples) = 0;
  /// Waits until the sink has taken all of the mesh.
  virtual void finish() = 0;
  /// Whole after finish().
  virtual SurfaceReport report() const = 0;
};

}  // namespace isobrick

#pragma once

#include <array>
#include <cstdint>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// A point of a level's lattice: whole numbers of steps from the origin of the grid.
using LatticePoint = std::array<std::int64_t, 3>;

/// A triangle between points of a lattice.
using LatticeTriangle = std::array<LatticePoint, 3>;

/// A place in the grid of fragments of a level, or in that of their halves.
using GridCell = std::array<std::uint32_t, 3>;

/// The grid that divides a mesh with levels of detail into fragments: cubes, of twice the edge on
/// each level. Positions are numbers of steps on a lattice, of which a fragment has kSteps along
/// each axis, so that its faces lie on the lattice and neighbours share their points.
struct ChunkGrid {
  /// Steps along the edge of a fragment: 16 bits of neuroglancer's format.
  static constexpr std::int64_t kSteps = 65535;
  /// The steps before the middle of a fragment, where neuroglancer parts those of coarse levels.
  static constexpr std::int64_t kMiddle = 32768;

  std::array<float, 3> origin{};                ///< in world units, as are the edges
  float edge = 1;                               ///< of the fragments of level 0
  std::array<std::uint32_t, 3> cells{1, 1, 1};  ///< fragments of level 0 along each axis

  /// Fragments along an axis of a level.
  std::uint32_t count(int axis, int level) const;
  /// The edge of a level's fragments.
  double edge_of(int level) const;
  /// The nearest point of a level's lattice.
  LatticePoint quantize(const Vec3f& position, int level) const;
  /// Levels until one fragment has the whole mesh.
  int levels() const;
};

/// The grid of a mesh within `bounds` whose fragments have edges of about `edge`, but as few as
/// numbers of 32 bits and neuroglancer can count.
ChunkGrid make_chunk_grid(const MeshBounds& bounds, double edge);

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Triangles near each other, with the vertices that they name.
struct TriangleGroup {
  std::vector<std::uint32_t> vertices;  ///< their numbers in the mesh, ascending
  std::vector<Vec3f> positions;         ///< of those
  std::vector<Triangle> triangles;      ///< that name `vertices` by their places
};

/// What a simplification of a group aims at.
struct GroupTarget {
  std::uint64_t triangles = 0;  ///< stops there
  /// No sample of the group's surface may end farther than this from the simplified surface; world
  /// units. Infinite: anywhere.
  double max_distance = 0;
  bool is_estimate = false;  ///< distances do not matter
};

/// The triangles that are left and how far the quadrics say that they lie from the group: Garland &
/// Heckbert, Surface simplification using quadric error metrics, 1997, as meshoptimizer does it.
struct SimplifiedGroup {
  std::vector<Triangle> triangles;  ///< name the group's vertices by their places
  double quadric_error = 0;         ///< world units
};

/// Collapses edges of a group. Vertices on open sides stay, so that groups that share sides fit
/// together afterwards. Each collapse gives the triangles of one vertex to another, so each side
/// keeps its reverse. Where the distance is exceeded, the triangles around stay in another attempt.
SimplifiedGroup simplify(const TriangleGroup& group, const GroupTarget& target);

/// The places in `from` of triangles of which a vertex or the centre is farther than `distance`
/// from the triangles `to`, which name the same positions.
std::vector<std::size_t> far_triangles(const std::vector<Vec3f>& positions,
                                       const std::vector<Triangle>& from,
                                       const std::vector<Triangle>& to, double distance);

}  // namespace isobrick

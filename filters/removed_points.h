#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/vectors.h"

namespace isobrick::inline v0 {

/// The squared distance from a point to a triangle: Ericson, Real-time collision detection, 2005,
/// section 5.1.5.
double squared_distance(Vec3d p, Vec3d a, Vec3d b, Vec3d c);

/// Keeps points of an original surface within a distance of what becomes of it. Each point belongs
/// to a triangle that is near enough.
class RemovedPoints {
 public:
  /// A triangle where a vertex's triangles were.
  struct Patch {
    std::uint32_t triangle;  ///< its number
    Vec3d a, b, c;
  };

  RemovedPoints(std::size_t triangles, double max_distance)
      : first_(triangles, kNone), max_square_(max_distance * max_distance) {}

  /// Adds a point on a triangle.
  void add(Vec3d point, std::uint32_t triangle) {
    points_.push_back({point, first_[triangle]});
    first_[triangle] = static_cast<std::uint32_t>(points_.size() - 1);
  }

  /// Whether a vertex and all points of the triangles around it are near enough to the patches that
  /// would replace those triangles: some keep their number, the others are `gone`.
  bool permits(Vec3d vertex, std::span<const Patch> patches, std::span<const std::uint32_t> gone);
  /// Does what was permitted last.
  void move(Vec3d vertex, std::span<const Patch> patches, std::span<const std::uint32_t> gone);

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  struct Point {
    Vec3d position;
    std::uint32_t next;  ///< of the same triangle
  };

  /// The nearest patch for a point; kNone where all are too far.
  std::uint32_t nearest(Vec3d point, std::span<const Patch> patches) const;
  bool find_nearest(std::uint32_t triangle, std::span<const Patch> patches);

  std::vector<Point> points_;
  std::vector<std::uint32_t> first_;  ///< of each triangle's points
  double max_square_;
  std::uint32_t vertex_to_ = kNone;  ///< the triangle that the vertex goes to
  /// Points and the triangles that they go to.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> moves_;
};

}  // namespace isobrick

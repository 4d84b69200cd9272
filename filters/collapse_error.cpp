#include "filters/collapse_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/vectors.h"
#include "filters/removed_points.h"

namespace isobrick::inline v0 {
namespace {

/// The triangles around each vertex.
class Fans {
 public:
  Fans(std::size_t vertices, std::span<const Triangle> triangles)
      : begin_(vertices + 1), members_(3 * triangles.size()) {
    for (const Triangle& t : triangles)
      for (const std::uint32_t v : t) ++begin_[v + 1];
    for (std::size_t v = 0; v < vertices; ++v) begin_[v + 1] += begin_[v];
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::uint32_t i = 0; i < triangles.size(); ++i)
      for (const std::uint32_t v : triangles[i]) members_[next[v]++] = i;
  }

  std::span<const std::uint32_t> around(std::uint32_t vertex) const {
    return {members_.data() + begin_[vertex], begin_[vertex + 1] - begin_[vertex]};
  }

 private:
  std::vector<std::uint32_t> begin_, members_;
};

/// The squared distance to a triangle, also to one without area: there to the nearest corner at
/// most.
double square_to(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const double square = squared_distance(p, a, b, c);
  if (std::isfinite(square)) return square;
  return std::min({dot(p - a, p - a), dot(p - b, p - b), dot(p - c, p - c)});
}

}  // namespace

double collapse_error(const TriangleGroup& group, std::span<const std::uint32_t> final_vertices,
                      std::span<const Triangle> left) {
  constexpr double unknown = std::numeric_limits<double>::infinity();
  const Fans fans(group.vertices, left);
  const auto at = [&](std::uint32_t v) {
    return to_double(group.positions[v]) - to_double(group.positions.front());
  };
  double largest = 0;  // all are squares
  // Goes from triangle to triangle as long as they get nearer. Once one is not above the largest
  // so far, the point does not count.
  const auto distance = [&](Vec3d point, Triangle nearest) {
    double least = unknown;
    for (bool is_nearer = true; is_nearer;) {
      is_nearer = false;
      for (const std::uint32_t v : Triangle(nearest))
        for (const std::uint32_t i : fans.around(v)) {
          const Triangle& t = left[i];
          const double square = square_to(point, at(t[0]), at(t[1]), at(t[2]));
          if (square <= largest) return square;
          if (!(square < least)) continue;
          least = square;
          nearest = t;
          is_nearer = true;
        }
    }
    return least;
  };
  std::vector<double> of_vertex(group.vertices, unknown);
  for (const Triangle& t : group.triangles) {
    const Triangle image{final_vertices[t[0]], final_vertices[t[1]], final_vertices[t[2]]};
    if (image == t) continue;
    const double of_centre = distance((at(t[0]) + at(t[1]) + at(t[2])) * (1.0 / 3), image);
    if (of_centre < unknown) largest = std::max(largest, of_centre);
    for (const std::uint32_t v : t)
      if (final_vertices[v] != v && of_vertex[v] > largest)
        of_vertex[v] = std::min(of_vertex[v], distance(at(v), image));
  }
  for (const double square : of_vertex)
    if (square < unknown) largest = std::max(largest, square);
  return std::sqrt(largest);
}

}  // namespace isobrick

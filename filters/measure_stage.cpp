#include "filters/measure_stage.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/vectors.h"

namespace isobrick::inline v0 {

template <class Number>
MeasureStage<Number>::MeasureStage(MeshSink& next, std::stop_token cancel,
                                   const ScratchPlace& place, std::uint64_t memory)
    : FilterStage(next, std::move(cancel)),
      positions_(place, memory / 2),
      sets_(place, memory / 4),
      sides_(place, memory / 4) {}

template <class Number>
void MeasureStage<Number>::begin(const MeshHeader& header) {
  measure_.unit = header.unit;
  next().begin(header);
}

template <class Number>
void MeasureStage<Number>::include(Vec3d p) {
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) return;
  if (!measure_.bounds) measure_.bounds = MeshBounds{p, p};
  for (int axis = 0; axis < 3; ++axis) {
    measure_.bounds->lo[axis] = std::min(measure_.bounds->lo[axis], p[axis]);
    measure_.bounds->hi[axis] = std::max(measure_.bounds->hi[axis], p[axis]);
  }
}

template <class Number>
void MeasureStage<Number>::add(const TriangleOf<Number>& triangle, const MeshChunk& chunk) {
  Vec3d corners[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint64_t vertex = triangle[i];
    corners[i] =
        to_double(vertex >= chunk.first_vertex
                      ? chunk.positions[static_cast<std::size_t>(vertex - chunk.first_vertex)]
                      : Vec3f(positions_[vertex]));
  }
  if (!origin_) origin_ = corners[0];
  const Vec3d product = cross(corners[1] - corners[0], corners[2] - corners[0]);
  area_.add(length(product));
  // Of the tetrahedron with the origin. The normal of the triangle is the same for all its corners.
  volume_.add(dot(corners[0] - *origin_, product));
  sets_.connect(triangle);
  sides_.add(triangle);
}

template <class Number>
void MeasureStage<Number>::write(const MeshChunk& chunk) {
  check_cancelled();
  check_vertex_count<Number>(positions_.size() + chunk.positions.size());
  positions_.append(chunk.positions);
  sets_.grow(positions_.size());
  for (const Vec3f& p : chunk.positions) include(to_double(p));
  const auto triangles = triangles_of<Number>(chunk, converted_);
  for (const auto& triangle : triangles) add(triangle, chunk);
  measure_.triangles += triangles.size();
  next().write(chunk);
}

template <class Number>
void MeasureStage<Number>::complete() {
  sides_.for_each([&](const typename OpenSides<Number>::Side& side) {
    measure_.open_sides += static_cast<std::uint64_t>(std::abs(side.excess));
  });
  measure_.vertices = sets_.used();
  measure_.components = sets_.sets();
  measure_.area = area_.value() / 2;
  if (measure_.is_closed()) measure_.volume = volume_.value() / 6;
  const std::uint64_t sides = (sides_.added() + measure_.open_sides) / 2;
  measure_.euler_number = static_cast<std::int64_t>(measure_.vertices + measure_.triangles) -
                          static_cast<std::int64_t>(sides);
}

template <class Number>
void MeasureStage<Number>::finish() {
  complete();
  positions_.release();
  sets_.release();
  sides_.release();
  next().finish();
}

template class MeasureStage<std::uint32_t>;
template class MeasureStage<std::uint64_t>;

}  // namespace isobrick

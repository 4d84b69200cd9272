#include "filters/smooth_stage.h"

#include <utility>
#include <vector>

#include "core/vectors.h"

namespace isobrick::inline v0 {

template <class Number>
SmoothStage<Number>::SmoothStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                                 std::uint64_t memory, const Smoothing& smoothing)
    : FilterStage(next, std::move(cancel)),
      smoothing_(smoothing),
      vertices_(place, memory / 2),
      normals_(place, memory / 16),
      triangles_(place, memory / 4),
      sides_(place, memory / 16 * 3) {}

template <class Number>
void SmoothStage<Number>::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  wide_ = header.wide;
  next().begin(header);
}

template <class Number>
void SmoothStage<Number>::write(const MeshChunk& chunk) {
  check_cancelled();
  check_vertex_count<Number>(vertices_.size() + chunk.positions.size());
  for (const Vec3f& position : chunk.positions) vertices_.push_back({.position = position});
  normals_.append(chunk.normals);
  const auto triangles = triangles_of<Number>(chunk, converted_);
  triangles_.append(triangles);
  for (const auto& triangle : triangles) sides_.add(triangle);
}

template <class Number>
void SmoothStage<Number>::fix_borders() {
  sides_.for_each([&](const typename OpenSides<Number>::Side& side) {
    vertices_.edit(side.lo()).is_fixed = 1;
    vertices_.edit(side.hi()).is_fixed = 1;
  });
  sides_.release();
}

template <class Number>
void SmoothStage<Number>::add_differences() {
  const auto add = [&](Number vertex, Vec3f difference) {
    Vertex& v = vertices_.edit(vertex);
    v.sum = v.sum + difference;
    v.differences += 2;
  };
  triangles_.for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& t : run) {
      const Vec3f a = vertices_[t[0]].position, b = vertices_[t[1]].position,
                  c = vertices_[t[2]].position;
      const Vec3f ab = b - a, bc = c - b, ca = a - c;
      add(t[0], ab - ca);
      add(t[1], bc - ab);
      add(t[2], ca - bc);
    }
    progress().advance(run.size_bytes());
  });
}

template <class Number>
void SmoothStage<Number>::move(double fraction) {
  vertices_.edit_runs([&](std::span<Vertex> run, std::uint64_t) {
    check_cancelled();
    for (Vertex& v : run) {
      if (v.is_fixed == 0 && v.differences > 0)
        v.position =
            v.position + v.sum * static_cast<float>(fraction / static_cast<double>(v.differences));
      v.sum = {};
      v.differences = 0;
    }
  });
}

template <class Number>
void SmoothStage<Number>::add_normals() {
  triangles_.for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& t : run) {
      const Vec3d a = to_double(vertices_[t[0]].position), b = to_double(vertices_[t[1]].position),
                  c = to_double(vertices_[t[2]].position);
      const Vec3f product = to_float(cross(b - a, c - a));
      for (const Number corner : t) {
        Vec3f& sum = vertices_.edit(corner).sum;
        sum = sum + product;
      }
    }
  });
}

template <class Number>
void SmoothStage<Number>::write_vertices() {
  std::vector<Vec3f> positions, normals;
  vertices_.for_each_run([&](std::span<const Vertex> run, std::uint64_t first) {
    check_cancelled();
    positions.clear();
    normals.clear();
    for (std::size_t i = 0; i < run.size(); ++i) {
      positions.push_back(run[i].position);
      if (has_normals_)
        normals.push_back(to_float(unit(to_double(run[i].sum), to_double(normals_[first + i]))));
    }
    next().write({.first_vertex = first, .positions = positions, .normals = normals});
  });
}

template <class Number>
void SmoothStage<Number>::finish() {
  fix_borders();
  const double mu = 1 / (smoothing_.pass_band - 1 / kLambda);
  progress().begin("smoothing", 2 * static_cast<std::uint64_t>(smoothing_.iterations) *
                                    triangles_.size() * sizeof(TriangleOf<Number>));
  for (int i = 0; i < smoothing_.iterations; ++i) {
    for (const double fraction : {kLambda, mu}) {
      add_differences();
      move(fraction);
    }
  }
  progress().end();
  if (has_normals_) add_normals();
  const std::uint64_t vertices = vertices_.size();
  write_vertices();
  vertices_.release();
  normals_.release();
  triangles_.for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    write_triangles<Number>(next(), wide_, vertices, run);
  });
  triangles_.release();
  next().finish();
}

template class SmoothStage<std::uint32_t>;
template class SmoothStage<std::uint64_t>;

}  // namespace isobrick

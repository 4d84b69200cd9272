#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <isobrick/mesh_filters.h>
#include <isobrick/mesh_sinks.h>
#include <isobrick/volume_extractor.h>

namespace isobrick::test {

/// The surface of f(x, y, z) = 0 on a lattice of n³ samples over [lo, hi]³, f positive inside.
template <class F>
Mesh surface_of(Index n, double lo, double hi, F&& f, bool normals = false) {
  std::vector<float> samples;
  const double step = (hi - lo) / static_cast<double>(n - 1);
  for_each_point({{0, 0, 0}, {n, n, n}}, [&](Int3 p) {
    samples.push_back(static_cast<float>(f(lo + step * static_cast<double>(p.x),
                                           lo + step * static_cast<double>(p.y),
                                           lo + step * static_cast<double>(p.z))));
  });
  Volume volume = Volume::of(samples.data(), {n, n, n});
  volume.transform.spacing = {step, step, step};
  volume.transform.origin = {lo, lo, lo};
  return extract(volume, {.isovalue = 0, .normals = normals});
}

inline double ball(double x, double y, double z, Vec3d centre, double radius) {
  return radius - std::hypot(x - centre.x, y - centre.y, z - centre.z);
}

inline Mesh sphere(Index n = 40, double radius = 1, bool normals = false) {
  return surface_of(
      n, -1.25, 1.25,
      [&](double x, double y, double z) {
        return ball(x, y, z, {0.01, 0.02, 0.03}, radius);
      },
      normals);
}

/// A lattice of balls whose sizes differ, and pieces cut off by the border.
inline Mesh debris(bool normals = false) {
  return surface_of(
      48, 0, 8,
      [](double x, double y, double z) {
        const double i = std::round(x), j = std::round(y), k = std::round(z);
        const double radius = 0.2 + 0.04 * std::fmod(3 * i + 5 * j + 7 * k, 6);
        return ball(x, y, z, {i, j, k}, radius);
      },
      normals);
}

inline void add(Mesh& to, const Mesh& mesh, Vec3f shift = {}) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  const std::size_t triangles = to.triangles.size();
  to.positions.resize(first + mesh.positions.size());
  to.triangles.resize(triangles + mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    to.positions[first + i] = mesh.positions[i] + shift;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    to.triangles[triangles + i] = {t[0] + first, t[1] + first, t[2] + first};
  }
}

/// Writes a mesh in chunks of so many triangles, each behind the vertices that it needs.
inline void write_chunks(const Mesh& mesh, MeshSink& sink, std::size_t chunk_triangles) {
  sink.begin({.has_normals = !mesh.normals.empty()});
  std::size_t vertices = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); i += chunk_triangles) {
    const auto triangles =
        mesh.triangles.span().subspan(i, std::min(chunk_triangles, mesh.triangles.size() - i));
    std::size_t end = vertices;
    for (const Triangle& t : triangles)
      end = std::max<std::size_t>({end, t[0] + 1u, t[1] + 1u, t[2] + 1u});
    if (i + chunk_triangles >= mesh.triangles.size()) end = mesh.positions.size();
    MeshChunk chunk{.first_vertex = vertices,
                    .positions = mesh.positions.span().subspan(vertices, end - vertices),
                    .triangles = triangles};
    if (!mesh.normals.empty())
      chunk.normals = mesh.normals.span().subspan(vertices, end - vertices);
    sink.write(chunk);
    vertices = end;
  }
  sink.finish();
}

struct Filtered {
  Mesh mesh;
  MeshSize size;
  std::optional<MeshMeasure> measure;
};

inline Filtered filtered(const Mesh& mesh, const MeshFilterOptions& options,
                         std::size_t chunk_triangles = std::size_t{1} << 20) {
  Filtered result;
  MemorySink sink(result.mesh);
  MeshFilter filter(sink, options);
  write_chunks(mesh, filter, chunk_triangles);
  result.size = filter.size();
  result.measure = filter.measure();
  return result;
}

inline bool same(const Mesh& a, const Mesh& b) {
  return std::ranges::equal(a.positions.span(), b.positions.span()) &&
         std::ranges::equal(a.normals.span(), b.normals.span()) &&
         std::ranges::equal(a.triangles.span(), b.triangles.span());
}

/// Open sides, counted with a map.
inline std::uint64_t open_sides_of(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      if (a < b)
        ++sides[{a, b}];
      else if (b < a)
        --sides[{b, a}];
    }
  std::uint64_t open = 0;
  for (const auto& [side, excess] : sides) open += static_cast<std::uint64_t>(std::abs(excess));
  return open;
}

/// By vertex, the smallest one of its component, by repeated relaxation.
inline std::vector<std::uint32_t> components_of(const Mesh& mesh) {
  std::vector<std::uint32_t> root(mesh.positions.size());
  for (std::uint32_t v = 0; v < root.size(); ++v) root[v] = v;
  for (bool changed = true; changed;) {
    changed = false;
    for (const Triangle& t : mesh.triangles) {
      const std::uint32_t least = std::min({root[t[0]], root[t[1]], root[t[2]]});
      for (const std::uint32_t v : t) {
        changed = changed || root[v] != least;
        root[v] = least;
      }
    }
  }
  return root;
}

/// The part of a mesh whose components `keep` accepts, made the plain way.
template <class Keep>
Mesh kept_components(const Mesh& mesh, Keep&& keep) {
  const std::vector<std::uint32_t> root = components_of(mesh);
  std::map<std::uint32_t, std::uint64_t> sizes;
  for (const Triangle& t : mesh.triangles) ++sizes[root[t[0]]];
  std::map<std::uint32_t, bool> is_kept;
  for (const auto& [first, size] : sizes) is_kept[first] = keep(sizes, first);
  std::vector<std::uint32_t> numbers(mesh.positions.size());
  std::vector<std::size_t> vertices;
  for (std::size_t v = 0; v < numbers.size(); ++v) {
    numbers[v] = static_cast<std::uint32_t>(vertices.size());
    if (is_kept[root[v]]) vertices.push_back(v);
  }
  Mesh result;
  result.positions.resize(vertices.size());
  if (!mesh.normals.empty()) result.normals.resize(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    result.positions[i] = mesh.positions[vertices[i]];
    if (!mesh.normals.empty()) result.normals[i] = mesh.normals[vertices[i]];
  }
  std::vector<Triangle> triangles;
  for (const Triangle& t : mesh.triangles)
    if (is_kept[root[t[0]]]) triangles.push_back({numbers[t[0]], numbers[t[1]], numbers[t[2]]});
  result.triangles.resize(triangles.size());
  std::ranges::copy(triangles, result.triangles.begin());
  return result;
}

}  // namespace isobrick::test

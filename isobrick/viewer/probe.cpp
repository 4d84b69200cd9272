#include "isobrick/viewer/probe.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "isobrick/viewer/node_mesher.h"

namespace isobrick {
namespace {

Vec3d to_double(Vec3f v) { return {v.x, v.y, v.z}; }

/// Components along the volume's axes, in samples of a level.
Vec3d turned(const Transform& t, Vec3d v) {
  const auto& d = t.direction;
  return {(d[0] * v.x + d[3] * v.y + d[6] * v.z) / t.spacing.x,
          (d[1] * v.x + d[4] * v.y + d[7] * v.z) / t.spacing.y,
          (d[2] * v.x + d[5] * v.y + d[8] * v.z) / t.spacing.z};
}

/// A ray in level-0 index space.
struct Ray {
  Vec3d from, along;

  /// Where it enters a box, in lengths of `along`; nothing where it passes by.
  std::optional<double> entry(const IndexBox& box, double margin) const {
    double near = 0, far = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double lo = box.lo[axis] - margin - from[axis], hi = box.hi[axis] + margin - from[axis];
      if (along[axis] == 0) {
        if (lo > 0 || hi < 0) return std::nullopt;
        continue;
      }
      const double a = lo / along[axis], b = hi / along[axis];
      near = std::max(near, std::min(a, b));
      far = std::min(far, std::max(a, b));
    }
    return near <= far ? std::optional(near) : std::nullopt;
  }
};

class Always final : public Wanted {
 public:
  void check() const override {}
};

/// Where a ray meets a triangle (Möller and Trumbore): distance and barycentric
/// coordinates of the second and third corner.
struct Meeting {
  double distance, u, v;
};
std::optional<Meeting> meet(Vec3d from, Vec3d along, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d ab = b - a, ac = c - a, p = cross(along, ac);
  const double det = dot(ab, p);
  if (det == 0) return std::nullopt;
  const Vec3d s = from - a;
  const double u = dot(s, p) / det;
  if (!(u >= 0 && u <= 1)) return std::nullopt;
  const Vec3d q = cross(s, ab);
  const double v = dot(along, q) / det, t = dot(ac, q) / det;
  if (!(v >= 0 && u + v <= 1 && t >= 0)) return std::nullopt;
  return Meeting{t, u, v};
}

bool inside(const IndexBox& box, Vec3d p) {
  for (int axis = 0; axis < 3; ++axis)
    if (p[axis] < box.lo[axis] || p[axis] > box.hi[axis]) return false;
  return true;
}

/// The field of one stored level.
template <class Find>
class Field {
 public:
  Field(const StoreInfo& info, int stored, Find find)
      : info_(info), lattice_(info.levels[static_cast<std::size_t>(stored)].lattice), find_(find) {}

  /// Trilinear; nothing when a sample is not there.
  std::optional<double> at(Vec3d p) const {
    Int3 first;
    double part[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double last = static_cast<double>(lattice_.extent[axis] - 1);
      const double x = std::clamp(p[axis], 0.0, last);
      first[axis] = static_cast<Index>(x);
      part[axis] = x - static_cast<double>(first[axis]);
    }
    double sum = 0;
    for (int c = 0; c < 8; ++c) {
      double weight = 1;
      Int3 sample = first;
      for (int axis = 0; axis < 3; ++axis) {
        const bool upper = c >> axis & 1;
        weight *= upper ? part[axis] : 1 - part[axis];
        sample[axis] += upper;
      }
      if (weight == 0) continue;
      const std::optional<double> value = sample_at(sample);
      if (!value) return std::nullopt;
      sum += weight * *value;
    }
    return sum;
  }

 private:
  std::optional<double> sample_at(Int3 p) const {
    const Int3 b{p.x / lattice_.brick.x, p.y / lattice_.brick.y, p.z / lattice_.brick.z};
    const std::shared_ptr<const BrickSamples> brick = find_(b);
    if (!brick) return std::nullopt;
    if (brick->empty()) return info_.fill_value;
    const auto i = static_cast<std::size_t>(linear_index(p - b * lattice_.brick, lattice_.brick));
    return visit_scalar(lattice_.type, [&](auto tag) {
      typename decltype(tag)::type v;
      std::memcpy(&v, brick->data() + i * sizeof v, sizeof v);
      return static_cast<double>(v);
    });
  }

  const StoreInfo& info_;
  Lattice lattice_;
  Find find_;
};

template <class Find>
std::optional<FieldValue> value_at(const StoreInfo& info, int stored, Vec3d world, Find find) {
  const LevelInfo& level = info.levels[static_cast<std::size_t>(stored)];
  const Transform& t = level.transform;
  const Vec3d p = turned(t, world - t.origin);
  const Field<Find> field(info, stored, find);
  const std::optional<double> value = field.at(p);
  if (!value) return std::nullopt;
  FieldValue out{*value, stored, {}};
  Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d a = p, b = p;
    const double last = static_cast<double>(level.lattice.extent[axis] - 1);
    a[axis] = std::clamp(p[axis] - 0.5, 0.0, last);
    b[axis] = std::clamp(p[axis] + 0.5, 0.0, last);
    if (a[axis] == b[axis]) continue;  // one sample thick
    const auto va = field.at(a), vb = field.at(b);
    if (!va || !vb) return out;
    gradient[axis] = (*vb - *va) / ((b[axis] - a[axis]) * t.spacing[axis]);
  }
  const auto& d = t.direction;
  const Vec3d n{-(d[0] * gradient.x + d[1] * gradient.y + d[2] * gradient.z),
                -(d[3] * gradient.x + d[4] * gradient.y + d[5] * gradient.z),
                -(d[6] * gradient.x + d[7] * gradient.y + d[8] * gradient.z)};
  const double size = std::sqrt(dot(n, n));
  if (size > 0 && std::isfinite(size))
    for (int axis = 0; axis < 3; ++axis) out.normal[axis] = static_cast<float>(n[axis] / size);
  return out;
}

bool in_volume(const NodeGrid& grid, Vec3d world) {
  const Int3 cells = grid.cells();
  return inside(
      {{0, 0, 0},
       {static_cast<double>(cells.x), static_cast<double>(cells.y), static_cast<double>(cells.z)}},
      to_index_space(grid, world));
}

/// Puts the first hit with a mesh where shown(position) into `best`, if it is nearer than that.
template <class Shown>
void hit_mesh(const NodeMesh& node, int isovalue, Vec3d origin, Vec3d from, Vec3d along,
              const Shown& shown, std::optional<SurfaceHit>& best) {
  const MeshBuffer& mesh = node.mesh;
  for (std::size_t i = 0; i + node.ribbon_triangles < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const auto corner = [&](std::size_t k) { return to_double(mesh.positions[t[k]]); };
    const auto met = meet(from - origin, along, corner(0), corner(1), corner(2));
    if (!met || (best && met->distance >= best->distance)) continue;
    const Vec3d position = from + along * met->distance;
    if (!shown(position)) continue;
    const Vec3d n = to_double(mesh.normals[t[0]]) * (1 - met->u - met->v) +
                    to_double(mesh.normals[t[1]]) * met->u + to_double(mesh.normals[t[2]]) * met->v;
    const double size = std::sqrt(std::max(dot(n, n), 1e-30));
    best = SurfaceHit{position,
                      {static_cast<float>(n.x / size), static_cast<float>(n.y / size),
                       static_cast<float>(n.z / size)},
                      isovalue,
                      node.key,
                      met->distance};
  }
}

}  // namespace

Vec3d to_index_space(const NodeGrid& grid, Vec3d world) {
  return turned(grid.transform(), world - grid.transform().origin);
}

std::optional<SurfaceHit> pick(const Drawable& drawn, const NodeGrid& grid, ResidentBricks& bricks,
                               Vec3d origin, Vec3d from, Vec3d along,
                               const std::optional<IndexBox>& clip,
                               std::span<const HalfSpace> planes) {
  const Ray ray{to_index_space(grid, from), turned(grid.transform(), along)};
  std::vector<std::pair<double, const DrawnNode*>> met;
  for (const DrawnNode& node : drawn.nodes)
    if (const auto entry = ray.entry(grid.box(node.mesh->key), 0.5))
      met.emplace_back(*entry, &node);
  std::stable_sort(met.begin(), met.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  const auto shown = [&](Vec3d position) {
    return (!clip || inside(*clip, to_index_space(grid, position))) &&
           std::all_of(planes.begin(), planes.end(),
                       [&](const HalfSpace& half) { return half.contains(position); });
  };
  std::optional<SurfaceHit> best;
  std::optional<NodeMesher> mesher;
  for (const auto& [entry, node] : met) {
    if (best && entry > best->distance) break;
    const NodeMesh& mesh = *node->mesh;
    std::optional<NodeMesh> again;
    if (mesh.device) {
      if (!mesher) mesher.emplace(grid, bricks, origin);
      again = mesher->mesh(mesh.key, mesh.isovalue, mesh.coarser, Always());
    }
    hit_mesh(again ? *again : mesh, node->isovalue, origin, from, along, shown, best);
  }
  return best;
}

std::optional<FieldValue> probe(const NodeGrid& grid, ResidentBricks& bricks, Vec3d world) {
  if (!in_volume(grid, world)) return std::nullopt;
  const StoreInfo& info = bricks.source().info();
  for (int stored = 0; stored < static_cast<int>(info.levels.size()); ++stored)
    if (const auto value =
            value_at(info, stored, world, [&](Int3 b) { return bricks.find(stored, b); }))
      return value;
  return std::nullopt;
}

}  // namespace isobrick

#include "viewer/scene/probe.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

namespace isobrick::inline v0 {
namespace {

/// Components along the volume's axes, in samples of a level.
Vec3d turned(const Transform& t, Vec3d v) {
  const auto& d = t.direction;
  return {(d[0] * v.x + d[3] * v.y + d[6] * v.z) / t.spacing.x,
          (d[1] * v.x + d[4] * v.y + d[7] * v.z) / t.spacing.y,
          (d[2] * v.x + d[5] * v.y + d[8] * v.z) / t.spacing.z};
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

  /// Trilinear interpolation; nullopt if a sample is not resident.
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
    if (brick->empty()) return double{info_.fill_value};
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

}  // namespace

Vec3d to_index_space(const NodeGrid& grid, Vec3d world) {
  return turned(grid.transform(), world - grid.transform().origin);
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

#include "pipeline/extract/mesh_header.h"

#include <fmt/format.h>

#include <cmath>

#include <isobrick/error.h>
#include "core/length_unit.h"

namespace isobrick::inline v0 {
namespace {

Vec3d as_point(Int3 p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}

/// Empty where the coordinates of a mesh fit 32 bits; else what is wrong.
std::string misfit(const Transform& transform, Int3 extent, const std::string& name) {
  // Coordinates are float, and so are the factors of positions and normals.
  constexpr double least = 1e-30, most = 1e30;
  const auto fits = [](double v, double lo) { return std::abs(v) >= lo && std::abs(v) <= most; };
  const Vec3d far = transform.apply({static_cast<double>(extent.x), static_cast<double>(extent.y),
                                     static_cast<double>(extent.z)});
  bool fit = true;
  for (int axis = 0; axis < 3; ++axis)
    fit = fit && fits(transform.spacing[axis], least) && fits(transform.origin[axis], 0) &&
          fits(far[axis], 0);
  if (fit) return {};
  return fmt::format(
      "the spacing or origin of {} does not fit the 32-bit coordinates of a mesh (1e-30 to 1e30)",
      name);
}

}  // namespace

MeshBounds world_bounds(const Transform& transform, Vec3d first, Vec3d last) {
  MeshBounds bounds;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p = transform.apply({corner & 1 ? last.x : first.x, corner & 2 ? last.y : first.y,
                                     corner & 4 ? last.z : first.z});
    for (int axis = 0; axis < 3; ++axis) {
      bounds.lo[axis] = corner ? std::fmin(bounds.lo[axis], p[axis]) : p[axis];
      bounds.hi[axis] = corner ? std::fmax(bounds.hi[axis], p[axis]) : p[axis];
    }
  }
  return bounds;
}

void check_coordinates(const Transform& transform, Int3 extent, const std::string& name) {
  const std::string wrong = misfit(transform, extent, name);
  if (!wrong.empty()) throw Error(wrong + "; convert it with another --spacing, --origin or unit");
}

void check_transform(const Transform& transform, Int3 extent, const std::string& name) {
  const std::string wrong = misfit(transform, extent, name);
  if (!wrong.empty()) throw UsageError(wrong + "; give another transform");
}

void check_roi(Box3 roi, Int3 extent) {
  const Box3 box{{0, 0, 0}, extent};
  if (roi.empty() || intersect(roi, box) != roi)
    throw UsageError(fmt::format(
        "the region {}:{},{}:{},{}:{} is empty or leaves the level's {}×{}×{} samples", roi.lo.x,
        roi.hi.x, roi.lo.y, roi.hi.y, roi.lo.z, roi.hi.z, extent.x, extent.y, extent.z));
}

MeshHeader mesh_header(const Transform& transform, Int3 extent, bool normals, Box3 active) {
  const MeshBounds all = world_bounds(transform, {0, 0, 0}, as_point(extent - Int3{1, 1, 1}));
  MeshHeader header{normals, all.lo, all.hi};
  header.unit = unit_name(transform.unit);
  // The last cells end at the samples behind them.
  if (!active.empty())
    header.surface = world_bounds(transform, as_point(active.lo), as_point(active.hi));
  return header;
}

}  // namespace isobrick

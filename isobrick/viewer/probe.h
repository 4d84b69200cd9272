#pragma once

#include <optional>
#include <span>

#include "isobrick/core/half_space.h"
#include "isobrick/viewer/drawable.h"
#include "isobrick/viewer/resident_bricks.h"

namespace isobrick {

/// Where a ray meets the surface that is drawn.
struct SurfaceHit {
  Vec3d position;    ///< world space
  Vec3f normal;      ///< unit, towards smaller samples
  int isovalue = 0;  ///< which of the cut's
  NodeKey node;
  double distance = 0;  ///< from the ray's origin, in lengths of its direction
};

/// The first hit of a ray with the triangles that are drawn, both in world space; ribbons do not
/// count. `origin`: what the meshes' positions are relative to. What lies outside of `clip`
/// (level-0 index space) or of one of `planes` is not hit.
///
/// Meshes that lie on a device are made once more, the nearest first, until one is hit: the same
/// triangles, of `bricks`, of which those that are not decoded are read. Throws what that throws.
std::optional<SurfaceHit> pick(const Drawable& drawn, const NodeGrid& grid, ResidentBricks& bricks,
                               Vec3d origin, Vec3d from, Vec3d along,
                               const std::optional<IndexBox>& clip = {},
                               std::span<const HalfSpace> planes = {});

/// The field at a point.
struct FieldValue {
  double value = 0;  ///< trilinear between samples of the stored level
  int stored = 0;    ///< which level that is
  Vec3f normal;      ///< unit, world space, towards smaller values; 0 where there is no gradient
};

/// The field at a world position on the finest level whose samples there are
/// decoded. Nothing outside of the volume or where no level is. Waits for nothing.
std::optional<FieldValue> probe(const NodeGrid& grid, ResidentBricks& bricks, Vec3d world);

/// From world space to level-0 index space.
Vec3d to_index_space(const NodeGrid& grid, Vec3d world);

}  // namespace isobrick

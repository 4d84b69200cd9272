#pragma once

#include <optional>

#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// The value of the field at a point.
struct FieldValue {
  double value = 0;  ///< trilinear between samples of the stored level
  int stored = 0;    ///< that stored level
  Vec3f normal;      ///< unit vector, world space, towards smaller values; 0 without a gradient
};

/// The field at a world position, on the finest level whose samples there are resident. Returns
/// nullopt outside the volume, or where no level is resident. Never waits.
std::optional<FieldValue> probe(const NodeGrid& grid, ResidentBricks& bricks, Vec3d world);

/// From world space to level-0 index space.
Vec3d to_index_space(const NodeGrid& grid, Vec3d world);

}  // namespace isobrick

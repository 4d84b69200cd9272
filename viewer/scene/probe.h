#pragma once

#include <optional>

#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

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

#pragma once

#include <isobrick/inside.h>
#include <isobrick/transform.h>
#include "surface/cell_math.h"

namespace isobrick::inline v0 {

/// The transform as both backends apply it, in float. `inside` turns triangles and normals round.
WorldMap world_map(const Transform& transform, Inside inside = Inside::above);

/// Whether nothing lies off the diagonal of `map.m`, so that leaving those terms
/// out changes no bit of a position.
bool is_diagonal(const WorldMap& map);

}  // namespace isobrick

#include "surface/world_map.h"

#include <cmath>

namespace isobrick::inline v0 {

WorldMap world_map(const Transform& t, Inside inside) {
  WorldMap map;
  for (int row = 0; row < 3; ++row) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(3 * row + axis);
      map.m[i] = static_cast<float>(t.direction[i] * t.spacing[axis]);
      map.normal[i] = static_cast<float>(t.direction[i] / t.spacing[axis]);
    }
    map.origin[row] = static_cast<float>(t.origin[row]);
  }
  const auto& d = t.direction;
  const double handed = d[0] * (d[4] * d[8] - d[5] * d[7]) - d[1] * (d[3] * d[8] - d[5] * d[6]) +
                        d[2] * (d[3] * d[7] - d[4] * d[6]);
  map.mirrored = handed * t.spacing.x * t.spacing.y * t.spacing.z < 0;
  if (inside == Inside::below) {
    map.mirrored = !map.mirrored;
    for (float& factor : map.normal) factor = -factor;
  }
  return map;
}

bool is_diagonal(const WorldMap& map) {
  for (int i = 0; i < 9; ++i)
    if (i % 4 != 0 && (map.m[i] != 0 || std::signbit(map.m[i]))) return false;
  // Adding +0 turns −0 into +0, which only an origin of −0 would let through.
  for (const float origin : map.origin)
    if (origin == 0 && std::signbit(origin)) return false;
  return true;
}

}  // namespace isobrick

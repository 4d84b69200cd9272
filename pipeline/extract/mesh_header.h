#pragma once

#include <string>

#include <isobrick/mesh.h>
#include <isobrick/transform.h>
#include "core/tile.h"

namespace isobrick::inline v0 {

/// Throws Error where the coordinates of a mesh do not fit 32 bits: `name` is of the store.
void check_coordinates(const Transform& transform, Int3 extent, const std::string& name);
/// The same for samples without a store, `name`, whose transform is the caller's: UsageError.
void check_transform(const Transform& transform, Int3 extent, const std::string& name);

/// Throws UsageError for a region that is empty or leaves the samples of `extent`.
void check_roi(Box3 roi, Int3 extent);

/// World-space bounds of a box of index space.
MeshBounds world_bounds(const Transform& transform, Vec3d first, Vec3d last);

/// What is known of a mesh of a volume before its first chunk. `active` are the cells of its active
/// blocks, in the region; an empty box where they are not known.
MeshHeader mesh_header(const Transform& transform, Int3 extent, bool normals, Box3 active);

/// Calls f(cells) for the cells of a tile's active blocks that lie between samples of `roi`.
template <class F>
void for_each_active_block(const TileWork& work, Box3 roi, F&& f) {
  const Box3 cells{roi.lo, max(roi.hi - Int3{1, 1, 1}, roi.lo)};
  for (int i = 0; i < 8; ++i) {
    if (!(work.active_blocks >> i & 1)) continue;
    const Box3 box = intersect(cells_of_block(work.tile, i), cells);
    if (!box.empty()) f(box);
  }
}

}  // namespace isobrick

#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <isobrick/store_reader.h>
#include "viewer/app/view_settings.h"
#include "viewer/render/camera.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/node_tree.h"
#include "viewer/scene/view.h"

// Converts settings and cameras to clip regions, views and picture settings of a volume.

namespace isobrick::inline v0 {

/// Completes settings: adds a surface if there is none, chooses an isovalue for surfaces with NaN,
/// and the volume's range for an empty window. The isovalue is the middle of the coarsest level's
/// values, which single outliers do not move.
void choose_values(ViewSettings& settings, const NodeTree& tree);

/// The part of a volume that axis clips and region leave, as fractions of the volume (0 … 1).
struct ClipRegion {
  Vec3d lo{0, 0, 0}, hi{1, 1, 1};
  bool whole() const { return lo == Vec3d{0, 0, 0} && hi == Vec3d{1, 1, 1}; }
};
ClipRegion clip_region(const ViewSettings& settings);

/// The half spaces of the clip planes that are on.
std::vector<HalfSpace> clip_half_spaces(const ViewSettings& settings);

/// The renderer's settings of a picture. `last`: the last sample of level 0.
PictureSettings picture_settings(const ViewSettings& settings, const Transform& transform,
                                 Vec3d last);

/// Finds out which half spaces of a picture may clip a mesh.
class ClipTest {
 public:
  explicit ClipTest(const PictureSettings& picture);
  /// MeshStyle::clip_mask of a mesh within `radius` of `middle`.
  std::uint16_t mask(Vec3d middle, double radius) const;
  /// MeshStyle::clip_mask of a node's mesh.
  std::uint16_t mask(const NodeGrid& grid, const NodeKey& node) const;

 private:
  std::vector<HalfSpace> half_spaces_;  ///< with unit normals
};

/// The view of a camera, for choosing nodes.
View view_of(const Camera& camera, int width, int height, double pixel_error);

/// The last sample of level 0, in its index space.
Vec3d last_sample(const StoreReader& store);

/// The corners of a box of level-0 index space, in world space. Bit 0 of the number is x.
std::array<Vec3d, 8> corners(const Transform& transform, Vec3d lo, Vec3d hi);

std::vector<WorldLine> edges(const std::array<Vec3d, 8>& corners);

}  // namespace isobrick

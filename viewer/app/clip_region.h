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

// What settings and a camera mean for a volume.

namespace isobrick {

/// Gives a surface to settings that have none, an isovalue to surfaces that have none
/// (in the middle of the coarsest level's values, which single far-off samples do not
/// move), and the volume's range to a window that is empty.
void choose_values(ViewSettings& settings, const NodeTree& tree);

/// The part of a volume that cuts and region leave, in parts of the volume (0 … 1).
struct ClipRegion {
  Vec3d lo{0, 0, 0}, hi{1, 1, 1};
  bool whole() const { return lo == Vec3d{0, 0, 0} && hi == Vec3d{1, 1, 1}; }
};
ClipRegion clip_region(const ViewSettings& settings);

/// What planes that are on leave.
std::vector<HalfSpace> clip_half_spaces(const ViewSettings& settings);

/// How a renderer draws what settings say, of a volume whose last sample is `last`.
PictureSettings picture_settings(const ViewSettings& settings, const Transform& transform,
                                 Vec3d last);

/// What cuts a picture.
class ClipTest {
 public:
  explicit ClipTest(const PictureSettings& picture);
  /// MeshStyle::clip_mask of what lies around `middle`.
  std::uint16_t mask(Vec3d middle, double radius) const;
  /// Of a node's mesh.
  std::uint16_t mask(const NodeGrid& grid, const NodeKey& node) const;

 private:
  std::vector<HalfSpace> half_spaces_;  ///< with normals of length 1
};

/// The camera's view of nodes.
View view_of(const Camera& camera, int width, int height, double pixel_error);

/// The last sample of level 0, in its index space.
Vec3d last_sample(const StoreReader& store);

/// The corners of a box of level-0 index space, in world space: bit 0 is x.
std::array<Vec3d, 8> corners(const Transform& transform, Vec3d lo, Vec3d hi);

/// The edges of a box with these corners.
std::vector<WorldLine> edges(const std::array<Vec3d, 8>& corners);

}  // namespace isobrick

#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "core/half_space.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// A view of a scene.
struct View {
  Vec3d eye;  ///< world space; unused in a parallel projection
  /// World space to clip space, column-major as in OpenGL: clip = M · (x, y, z, 1), visible where
  /// −w <= x, y, z <= w. Depth from 0 to w, reversed or without a far plane, is allowed.
  std::array<double, 16> view_projection{};
  int width = 1, height = 1;  ///< of the picture, in pixels
  double pixel_error = 1.5;   ///< maximum length of a cell's edge on the picture, in pixels
  /// The same where a preview loses thin structure, if that is smaller; for a picture that is shown
  /// enlarged.
  double thin_pixel_error = std::numeric_limits<double>::infinity();
  int finest_level = 0;  ///< level of the NodeGrid; finer nodes are not shown
  /// Clip box in level-0 index space; nullopt: the whole volume.
  std::optional<IndexBox> clip;
  std::vector<HalfSpace> planes;  ///< clip planes; what lies within all of them is shown

  friend bool operator==(const View&, const View&) = default;
};

/// The size and visibility of a node in a view.
struct NodeSight {
  /// Length of a cell on the picture, in pixels, at the node's point nearest to the eye. It does
  /// not depend on the direction of view.
  double pixels = 0;
  double distance = 0;          ///< from the eye to the node, world units
  bool clipped = false;         ///< completely outside the clip box or a clip plane
  bool visible = false;         ///< false only if clipped or outside the picture
  bool nearly_visible = false;  ///< visible in a picture that is a little larger
};

/// A view in the volume's own axes, for tests against nodes.
class NodeView {
 public:
  NodeView(const View& view, const NodeGrid& grid);

  NodeSight sight(const NodeKey& n) const;
  /// Computes NodeSight::clipped alone.
  bool clips(const NodeKey& n) const {
    return (clip_ || !planes_.empty()) && clipped(grid_.box(n));
  }

 private:
  struct Plane {
    Vec3d normal;
    double offset;  ///< inside: normal · p + offset >= 0

    /// Whether some point of the box lies inside.
    bool intersects(const IndexBox& box) const;
  };
  using Planes = std::array<Plane, 6>;

  Plane to_index_space(Vec3d normal, double offset) const;
  bool clipped(const IndexBox& box) const;
  double pixels(int level, double distance) const;
  double distance(const IndexBox& box) const;

  const NodeGrid& grid_;
  Vec3d spacing_, eye_;  ///< the eye in world units along the volume's axes, from its origin
  Planes picture_, wider_;
  std::optional<IndexBox> clip_;
  std::vector<Plane> planes_;
  double pixels_per_length_ = 0;  ///< at distance 1; everywhere in a parallel projection
  bool parallel_ = false;
};

}  // namespace isobrick

#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "core/half_space.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

/// From where and how a scene is seen.
struct View {
  Vec3d eye;  ///< world space; of no meaning where the projection is parallel
  /// World space to clip space, column-major as OpenGL has it:
  /// clip = M · (x, y, z, 1), visible where −w <= x, y, z <= w. Depth from 0 to w,
  /// also reversed or without a far end, does as well.
  std::array<double, 16> view_projection{};
  int width = 1, height = 1;  ///< of the picture, pixels
  double pixel_error = 1.5;   ///< how long a cell's edge may be on the picture, pixels
  /// Where a preview loses thin structure, if that is shorter: for a picture that is shown larger.
  double thin_pixel_error = std::numeric_limits<double>::infinity();
  int finest_level = 0;  ///< of a NodeGrid; no node of a finer one is shown
  /// What is shown of the volume, in level-0 index space; nothing: all.
  std::optional<IndexBox> clip;
  std::vector<HalfSpace> planes;  ///< what lies within all of them is shown

  friend bool operator==(const View&, const View&) = default;
};

/// How a node looks in a view.
struct NodeSight {
  /// Length of one of the node's cells on the picture, pixels, where the node is
  /// nearest. The direction of the view does not enter it.
  double pixels = 0;
  double distance = 0;          ///< from the eye to the node, world length
  bool clipped = false;         ///< nothing of the node lies within the clip box and all planes
  bool visible = false;         ///< false: cut away or outside of the picture for certain
  bool nearly_visible = false;  ///< the same for a picture that is a little larger
};

/// A view in the volume's own axes: what nodes are tested against.
class NodeView {
 public:
  NodeView(const View& view, const NodeGrid& grid);

  NodeSight see(const NodeKey& n) const;
  /// NodeSight::clipped alone.
  bool clips(const NodeKey& n) const {
    return (clip_ || !planes_.empty()) && clipped(grid_.box(n));
  }

 private:
  struct Plane {
    Vec3d normal;
    double offset;  ///< inside: normal · p + offset >= 0

    /// Whether any of the box lies inside.
    bool meets(const IndexBox& box) const;
  };
  using Planes = std::array<Plane, 6>;

  Plane to_index_space(Vec3d normal, double offset) const;
  bool clipped(const IndexBox& box) const;
  double pixels(int level, double distance) const;
  double distance(const IndexBox& box) const;

  const NodeGrid& grid_;
  Vec3d spacing_, eye_;  ///< the eye in lengths along the volume's axes, from its origin
  Planes picture_, wider_;
  std::optional<IndexBox> clip_;
  std::vector<Plane> planes_;
  double pixels_per_length_ = 0;  ///< at distance 1, or anywhere
  bool parallel_ = false;
};

}  // namespace isobrick

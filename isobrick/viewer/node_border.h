#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "isobrick/viewer/node_samples.h"

namespace isobrick {

/// Where a node meets coarser neighbours: values on its border, and places on
/// the coarser side's contours.
class NodeBorder {
 public:
  NodeBorder(const NodeGrid& grid, NodeSamples& samples) : grid_(grid), samples_(samples) {}

  /// Reads the neighbours' values and writes them over `field`: the grid points of
  /// the node, C order.
  void apply(const NodeKey& key, std::uint32_t coarser, double isovalue, const Wanted& wanted,
             GridValues& field);

  /// Whether the neighbour over a face (2 · axis + side) is a coarser one.
  bool meets(int face) const { return faces_[static_cast<std::size_t>(face)].has_value(); }

  /// A vertex of the finer side on face `face` (2 · axis + side), given as grid
  /// point below (global), part of the way to the next, and place (level-0 index
  /// space): moved onto the contour of the coarser side, if it is not on an edge
  /// of the coarser grid anyway.
  Vec3d moved(int face, Int3 below, Vec3d part, Vec3d place) const;

 private:
  void take_values(int i, double isovalue, const Wanted& wanted, GridValues& field);
  void connect_inside(int face, GridValues& field) const;
  bool interior(int axis, Index below, double part) const;
  float interpolated(const GridValues& coarse, Int3 point) const;
  /// The two coarse grid points around a grid point, and how far it is from the first.
  struct Between {
    Index first;
    double weight;
  };
  Between between(int axis, Index point) const;

  const NodeGrid& grid_;
  NodeSamples& samples_;
  NodeKey key_;
  Int3 ratio_, lo_, hi_;                            ///< grid points of the node, both inclusive
  std::array<std::optional<GridValues>, 6> faces_;  ///< the coarser side's values
  GridValues scratch_;
};

}  // namespace isobrick

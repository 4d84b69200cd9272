#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "surface/grid_view.h"
#include "viewer/scene/node_samples.h"

namespace isobrick {

/// Where a node meets coarser neighbours: the values on its border.
class NodeBorder {
 public:
  NodeBorder(const NodeGrid& grid, NodeSamples& samples) : grid_(grid), samples_(samples) {}

  /// Reads the neighbours' values and writes them over `field`: the grid points of
  /// the node, C order.
  void apply(const NodeKey& key, std::uint32_t coarser, double isovalue,
             const CancellationToken& token, GridValues& field);

  /// After apply(): what a mesh of the node has to know of the coarser side. Valid until
  /// the next apply().
  void describe(GridView& view);

 private:
  void take_values(int i, double isovalue, const CancellationToken& token, GridValues& field);
  void connect_inside(int face, GridValues& field) const;
  void connect_through(Int3 middle, int u, int v, float inside, GridValues& field) const;
  float interpolated(const GridValues& coarse, Int3 point) const;
  /// The two coarse grid points around a grid point, and how far it is from the first.
  struct Interpolation {
    Index first;
    double weight;
  };
  Interpolation interpolation(int axis, Index point) const;

  const NodeGrid& grid_;
  NodeSamples& samples_;
  NodeKey key_;
  Int3 ratio_, lo_, hi_;                            ///< grid points of the node, both inclusive
  std::array<std::optional<GridValues>, 6> faces_;  ///< the coarser side's values
  std::array<std::vector<double>, 3> places_;       ///< of the coarser grid's points
  GridValues scratch_;
};

}  // namespace isobrick

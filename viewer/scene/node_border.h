#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "surface/grid_view.h"
#include "viewer/scene/node_samples.h"

namespace isobrick::inline v0 {

/// The values on a node's border to coarser neighbours.
class NodeBorder {
 public:
  NodeBorder(const NodeGrid& grid, NodeSamples& samples) : grid_(grid), samples_(samples) {}

  /// Reads the values of the neighbours in the mask `coarser` and writes them over those of
  /// `field`, the grid points of the node in C order.
  void apply(const NodeKey& key, std::uint32_t coarser, double isovalue,
             const CancellationToken& token, GridValues& field);

  /// After apply(): adds to `view` what the extractor needs of the coarser side. Valid until the
  /// next apply().
  void describe(GridView& view);

 private:
  void take_values(int i, double isovalue, const CancellationToken& token, GridValues& field);
  void connect_inside(int face, GridValues& field) const;
  void connect_through(Int3 middle, int u, int v, float inside, GridValues& field) const;
  float interpolated(const GridValues& coarse, Int3 point) const;
  /// The first of the two coarse grid points around a grid point, and the fraction of the way to
  /// the second.
  struct Interpolation {
    Index first;
    double weight;
  };
  Interpolation interpolation(int axis, Index point) const;

  const NodeGrid& grid_;
  NodeSamples& samples_;
  NodeKey key_;
  Int3 ratio_, lo_, hi_;                            ///< grid points of the node; `hi_` is inclusive
  std::array<std::optional<GridValues>, 6> faces_;  ///< values of the coarser side
  std::array<std::vector<double>, 3> places_;       ///< positions of the coarser grid's points
  GridValues scratch_;
};

}  // namespace isobrick

#include "surface/sample_vertices.h"

#include <algorithm>

namespace isobrick::inline v0 {

void adopt_samples(const TileState& tile, PodBuffer<SharedSample> TileBoundary::*published,
                   const BoundaryMap& map, PodBuffer<SampleVertex>& vertices) {
  for (SampleVertex& vertex : vertices) {
    if (vertex.owner == SampleVertex::kOwn) {
      vertex.number += tile.number_base;
      continue;
    }
    const Int3 offset = offset_of(vertex.owner);
    const TileBoundary& from = *map.find(tile.work.tile + offset);
    const auto along = [&](int axis) {
      return static_cast<std::uint32_t>((vertex.place >> 6 * axis & 63) - kTileEdge * offset[axis]);
    };
    const std::uint32_t place = along(0) | along(1) << 6 | along(2) << 12;
    const PodBuffer<SharedSample>& samples = from.*published;
    const SharedSample* found = std::lower_bound(
        samples.begin(), samples.end(), place,
        [](const SharedSample& sample, std::uint32_t p) { return sample.place < p; });
    vertex.number = from.base + found->number;
  }
}

}  // namespace isobrick

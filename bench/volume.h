#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range.h>
#include <isobrick/volume_source.h>
#include "index/leaf_ranges.h"

namespace isobrick::bench {

/// A volume in memory, C order [z, y, x].
struct Volume {
  Int3 extent;
  ScalarType type = ScalarType::u8;
  std::vector<std::byte> samples;

  template <class T>
  const T* data() const {
    return reinterpret_cast<const T*>(samples.data());
  }
  /// The samples between which the cells [lo, hi) lie.
  template <class T>
  SampleBlock<T> block(Int3 lo, Int3 hi) const {
    return {data<T>() + linear_index(lo, extent), min(hi + Int3{1, 1, 1}, extent) - lo, extent.x,
            extent.x * extent.y};
  }
};

/// All of a source that can be read in any order.
Volume read_all(VolumeSource& source);
/// A raw volume named as open_source takes it.
Volume read_raw(const std::string& path);

/// The ranges of the blocks of 16³ cells; parallel in the caller's arena.
template <class T>
void find_block_ranges(const Volume& v, std::vector<ValueRange<T>>& ranges) {
  const Int3 e = v.extent, grid = Lattice{e, {64, 64, 64}, v.type}.blocks();
  ranges.assign(static_cast<std::size_t>(volume(grid)), {});
  tbb::parallel_for(Index{0}, grid.z, [&](Index z) {
    std::vector<ValueRange<T>> layer;
    const Index top = std::min((z + 1) * kBlockEdge, e.z - 1);
    leaf_ranges(v.block<T>({0, 0, z * kBlockEdge}, {e.x, e.y, top}), kBlockEdge, layer);
    const Int3 found = leaf_grid({e.x, e.y, top - z * kBlockEdge + 1}, kBlockEdge);
    for (Index y = 0; y < found.y && found.z > 0; ++y)
      for (Index x = 0; x < found.x; ++x)
        ranges[static_cast<std::size_t>(linear_index({x, y, z}, grid))] =
            layer[static_cast<std::size_t>(linear_index({x, y, 0}, found))];
  });
}

}  // namespace isobrick::bench

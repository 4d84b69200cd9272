#include "tools/value_range.h"

#include <algorithm>

namespace isobrick::tools {

ValueRange<double> value_range(const StoreReader& store, int level) {
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  const Int3 bricks = info.lattice.bricks();
  ValueRange<double> range;
  for (Index z = 0; z < bricks.z; z += StoreReader::kRangeChunk) {
    const Box3 layer{{0, 0, z},
                     {bricks.x, bricks.y, std::min(bricks.z, z + StoreReader::kRangeChunk)}};
    for (const auto& of_brick : store.brick_ranges(level, layer).ranges) range.include(of_brick);
  }
  return range;
}

std::string range_text(const StoreReader& store, int level) {
  return isobrick::range_text(value_range(store, level), store.info().type, level);
}

std::string why_out_of_range(const StoreReader& store, int level, double isovalue) {
  if (!store.has_ranges(level)) return {};
  return isobrick::why_out_of_range(value_range(store, level), store.info().type, level, isovalue);
}

}  // namespace isobrick::tools

#include "tools/value_range.h"

#include <algorithm>

#include <fmt/format.h>

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

std::string sample_text(double value, ScalarType type) {
  return type == ScalarType::f32 ? fmt::format("{}", static_cast<float>(value))
                                 : fmt::format("{}", value);
}

}  // namespace isobrick::tools

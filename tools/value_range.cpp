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

namespace {

std::string range_text(const ValueRange<double>& range, const StoreReader& store, int level) {
  if (range.empty()) return "no sample is a number";
  const ScalarType type = store.info().type;
  return fmt::format("the samples of level {} lie within {} and {}", level,
                     sample_text(range.lo, type), sample_text(range.hi, type));
}

}  // namespace

std::string range_text(const StoreReader& store, int level) {
  return range_text(value_range(store, level), store, level);
}

std::string why_out_of_range(const StoreReader& store, int level, double isovalue) {
  if (!store.has_ranges(level)) return {};
  const ValueRange<double> range = value_range(store, level);
  if (!range.empty() && range.lo < isovalue && isovalue <= range.hi) return {};
  return fmt::format("isovalue {}: the surface is empty; {}", isovalue,
                     range_text(range, store, level));
}

}  // namespace isobrick::tools

#include "isobrick/pipeline/stored_bricks.h"

namespace isobrick {

std::uint64_t for_each_stored_brick(const StoreReader& store, int level, Box3 box,
                                    const std::function<void(Int3 brick)>& f) {
  const StoreInfo& info = store.info();
  const Box3 bricks = info.levels[static_cast<std::size_t>(level)].lattice.bricks_of(box);
  // Ranges say nothing of samples that are no numbers.
  const bool by_ranges = store.has_ranges(level) && !info.may_have_nan;
  constexpr Int3 group{StoreReader::kRangeChunk, StoreReader::kRangeChunk,
                       StoreReader::kRangeChunk};
  std::uint64_t looked_up = 0;
  for_each_point({floor_div(bricks.lo, group), ceil_div(bricks.hi, group)}, [&](Int3 g) {
    const Box3 part = intersect({g * group, (g + Int3{1, 1, 1}) * group}, bricks);
    RangeTable ranges;
    if (by_ranges) ranges = store.brick_ranges(level, part);
    for_each_point(part, [&](Int3 b) {
      if (by_ranges && ranges.at(b).lo == info.fill_value && ranges.at(b).hi == info.fill_value)
        return;
      ++looked_up;
      if (store.locate(level, b)) f(b);
    });
  });
  return looked_up;
}

}  // namespace isobrick

#include "pipeline/stored_bricks.h"

#include <cmath>

namespace isobrick::inline v0 {

void for_each_range_file(Box3 bricks, const std::function<void(Box3 part)>& f) {
  constexpr Int3 file{StoreReader::kRangeChunk, StoreReader::kRangeChunk, StoreReader::kRangeChunk};
  for_each_point({floor_div(bricks.lo, file), ceil_div(bricks.hi, file)}, [&](Int3 p) {
    f(intersect({p * file, (p + Int3{1, 1, 1}) * file}, bricks));
  });
}

std::uint64_t for_each_stored_brick(const StoreReader& store, int level, Box3 box,
                                    Progress& progress, const std::function<void(Int3 brick)>& f) {
  const StoreInfo& info = store.info();
  const Lattice& lattice = info.levels[static_cast<std::size_t>(level)].lattice;
  // Ranges include neither NaN nor the signs of zeros, and round 64-bit integers.
  const bool by_ranges = store.has_ranges(level) && !info.may_have_nan &&
                         (!is_floating(lattice.type) || info.fill_value != 0) &&
                         (!is_wide_integer(info.stored_type) || std::abs(info.fill_value) < 0x1p53);
  std::uint64_t looked_up = 0, passed = 0;
  const auto advance = [&] {
    progress.advance(passed * lattice.brick_bytes());
    passed = 0;
  };
  for_each_range_file(lattice.bricks_of(box), [&](Box3 part) {
    RangeTable ranges;
    if (by_ranges) ranges = store.brick_ranges(level, part);
    for_each_point(part, [&](Int3 b) {
      ++passed;
      if (by_ranges && ranges.at(b).lo == info.fill_value && ranges.at(b).hi == info.fill_value)
        return;
      ++looked_up;
      if (!store.locate(level, b)) return;
      f(b);
      advance();
    });
    advance();
  });
  return looked_up;
}

}  // namespace isobrick

#include <gtest/gtest.h>

#include "index/active_tiles.h"
#include "index/block_index.h"
#include "tests/index/range_sets.h"

// Whatever the structure, the tiles are those of the linear scan, in its order.

namespace isobrick::inline v0 {
namespace {

template <class T>
std::vector<ValueRange<T>> ranges_of(Int3 blocks, std::uint32_t seed) {
  Dice dice(seed);
  std::vector<ValueRange<T>> ranges;
  for (Index i = 0; i < volume(blocks); ++i) {
    const double a = dice.unit(), width = 0.2 * dice.unit();
    ranges.push_back(dice.below(5) == 0 ? ValueRange<T>{} : range_at<T>(a, a + width * (1 - a)));
  }
  return ranges;
}

bool same(const std::vector<TileWork>& a, const std::vector<TileWork>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](auto& p, auto& q) {
           return p.tile == q.tile && p.active_blocks == q.active_blocks;
         });
}

template <class T>
void compare(Int3 blocks) {
  const auto ranges = ranges_of<T>(blocks, 7);
  for (const IndexKind kind : kIndexKinds) {
    const BlockIndex index(kind, blocks, std::span<const ValueRange<T>>(ranges));
    EXPECT_EQ(index.kind(), kind);
    for (const double fraction : {0.0, 0.1, 0.33, 0.5, 0.77, 1.0})
      for (const double shift : {0.0, 0.5}) {
        const double isovalue = static_cast<double>(value_at<T>(fraction)) + shift;
        std::vector<TileWork> expected, found;
        append_active_tiles<T>({{0, 0, 0}, blocks}, ranges, isovalue, expected);
        index.append_active_tiles(isovalue, found);
        EXPECT_TRUE(same(expected, found)) << name_of(kind) << ", isovalue " << isovalue << ": "
                                           << found.size() << " tiles for " << expected.size();
      }
  }
}

TEST(BlockIndex, FindsTheTilesOfTheLinearScan) {
  for (const Int3 blocks : {Int3{1, 1, 1}, Int3{2, 2, 2}, Int3{7, 3, 5}, Int3{16, 16, 16},
                            Int3{1, 31, 9}, Int3{33, 2, 1}}) {
    compare<std::uint8_t>(blocks);
    compare<std::int16_t>(blocks);
    compare<float>(blocks);
  }
}

}  // namespace
}  // namespace isobrick

#include "stream/index_search.h"

#include <gtest/gtest.h>

#include <random>

#include <isobrick/error.h>
#include "index/span_index.h"

namespace isobrick::test {
namespace {

TEST(MarkedBlocks, AreThoseOfTheMarkedItems) {
  std::mt19937 random(1);
  for (const Index leaf : {1, 2, 4, 8, 16})
    for (const Int3 cells : {Int3{64, 64, 64}, Int3{1, 1, 1}, Int3{63, 17, 64}, Int3{33, 64, 5}}) {
      const Int3 grid = ceil_div(cells, {leaf, leaf, leaf});
      const auto items = static_cast<std::uint64_t>(volume(grid));
      for (const std::uint64_t marks : {std::uint64_t{0}, std::uint64_t{1}, items / 50, items}) {
        std::vector<std::uint64_t> words(mask_words(items));
        std::uint64_t expected = 0;
        for (std::uint64_t k = 0; k < marks; ++k) {
          const std::uint64_t id = marks == items ? k : random() % items;
          words[id / 64] |= std::uint64_t{1} << id % 64;
          const auto i = static_cast<Index>(id);
          const Index x = i % grid.x * leaf / 16, y = i / grid.x % grid.y * leaf / 16,
                      z = i / (grid.x * grid.y) * leaf / 16;
          expected |= std::uint64_t{1} << (x + 4 * y + 16 * z);
        }
        EXPECT_EQ(marked_blocks(words, grid, leaf), expected) << leaf << " " << marks;
      }
    }
}

TEST(IndexPart, MustBeTheOneThatItsPlaceSays) {
  const std::vector<ValueRange<std::uint8_t>> ranges{{1, 5}, {2, 2}, {0, 9}, {3, 4}};
  const auto bytes = build_index<std::uint8_t>(IndexKind::kdtree, ranges, {2, 2, 1});
  EXPECT_EQ(open_index_part(bytes, IndexKind::kdtree, ScalarType::u8, {2, 2, 1}).stored(), 3u);
  EXPECT_THROW(open_index_part(bytes, IndexKind::octree, ScalarType::u8, {2, 2, 1}), DamageError);
  EXPECT_THROW(open_index_part(bytes, IndexKind::kdtree, ScalarType::i8, {2, 2, 1}), DamageError);
  EXPECT_THROW(open_index_part(bytes, IndexKind::kdtree, ScalarType::u8, {4, 1, 1}), DamageError);
  auto broken = bytes;
  broken[16] = std::byte{9};
  EXPECT_THROW(open_index_part(broken, IndexKind::kdtree, ScalarType::u8, {2, 2, 1}), DamageError);
}

}  // namespace
}  // namespace isobrick::test

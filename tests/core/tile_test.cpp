#include "isobrick/core/tile.h"

#include <gtest/gtest.h>

#include <vector>

namespace isobrick {
namespace {

// The boxes must hold every sample of the closed active blocks and `reach`
// layers more, for all 255 sets of blocks.
TEST(TileWork, NeededBoxesCoverTheActiveBlocks) {
  const Lattice lattice{{70, 60, 50}, {16, 16, 16}, ScalarType::u8};
  for (const Int3 tile : {Int3{0, 0, 0}, Int3{1, 1, 1}, Int3{2, 0, 1}})
    for (int active = 1; active < 256; ++active)
      for (const Index reach : {0, 1}) {
        std::vector<bool> covered(static_cast<std::size_t>(volume(lattice.extent)));
        const auto index = [&](Int3 p) {
          return static_cast<std::size_t>(linear_index(p, lattice.extent));
        };
        for_each_needed_box(lattice, {tile, static_cast<std::uint8_t>(active), 0}, reach,
                            [&](Box3 box) {
                              EXPECT_EQ(intersect(box, lattice.box()), box);
                              EXPECT_FALSE(box.empty());
                              for_each_point(box, [&](Int3 p) { covered[index(p)] = true; });
                            });
        for (int i = 0; i < 8; ++i) {
          if (!(active >> i & 1)) continue;
          const Int3 corner = tile * kTileEdge + Int3{i & 1, i >> 1 & 1, i >> 2} * kBlockEdge;
          const Box3 block{corner - Int3{reach, reach, reach},
                           corner + Int3{17 + reach, 17 + reach, 17 + reach}};
          for_each_point(intersect(block, lattice.box()), [&](Int3 p) {
            ASSERT_TRUE(covered[index(p)]) << active << " block " << i;
          });
        }
      }
}

}  // namespace
}  // namespace isobrick

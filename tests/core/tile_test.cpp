#include "core/tile.h"

#include <gtest/gtest.h>

#include <vector>

namespace isobrick::inline v0 {
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
        for_each_needed_box(lattice, {tile, static_cast<std::uint8_t>(active)}, reach,
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

TEST(TileWork, ATileWithoutLayersAroundIsTheSamplesThatItsCellsBeginAt) {
  const Lattice lattice{{70, 60, 50}, {16, 16, 16}, ScalarType::u8};
  for (const Int3 tile : {Int3{0, 0, 0}, Int3{1, 1, 1}, Int3{2, 0, 1}}) {
    std::vector<Box3> boxes;
    for_each_needed_box(lattice, {tile, 0xff}, kFirstCorners,
                        [&](Box3 box) { boxes.push_back(box); });
    ASSERT_EQ(boxes.size(), 1u);
    const Int3 origin = tile * kTileEdge, edge{kTileEdge, kTileEdge, kTileEdge};
    EXPECT_EQ(boxes[0], intersect({origin, origin + edge}, lattice.box()));
  }
}

// What the side of blocks that are not active is taken from: a sample of every
// block that exists, and needed whichever of them is active.
TEST(TileWork, AllBlocksOfATileShareASample) {
  for (const Index last : {33, 34, 47, 48, 49, 50, 63, 64, 65, 80}) {
    const Lattice lattice{{last, 49, 90}, {16, 16, 16}, ScalarType::u8};
    for_each_point({{0, 0, 0}, lattice.tiles()}, [&](Int3 tile) {
      const Int3 common = tile * kTileEdge + common_sample(lattice.extent, tile);
      for (int i = 0; i < 8; ++i) {
        const Int3 block = tile * 2 + Int3{i & 1, i >> 1 & 1, i >> 2};
        if (!Box3{{0, 0, 0}, lattice.blocks()}.contains(block)) continue;
        const Int3 corner = block * kBlockEdge;
        EXPECT_TRUE(intersect({corner, corner + Int3{17, 17, 17}}, lattice.box()).contains(common));
        bool needed = false;
        for_each_needed_box(lattice, {tile, static_cast<std::uint8_t>(1 << i)}, 0,
                            [&](Box3 box) { needed = needed || box.contains(common); });
        EXPECT_TRUE(needed);
      }
    });
  }
}

}  // namespace
}  // namespace isobrick

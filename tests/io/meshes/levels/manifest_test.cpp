#include "io/meshes/levels/manifest.h"

#include <gtest/gtest.h>

#include "io/meshes/levels/fragment_mesh.h"

namespace isobrick::test {
namespace {

EncodedFragment fragment(const GridCell& cell, std::uint32_t bytes, std::uint8_t halves = 1) {
  return {z_order_key(cell), bytes, halves};
}

std::vector<std::pair<GridCell, std::uint32_t>> listed(const ManifestLevel& level) {
  std::vector<std::pair<GridCell, std::uint32_t>> all;
  for (const EncodedFragment& f : level.fragments) all.emplace_back(cell_of_key(f.key), f.bytes);
  return all;
}

using Listed = std::vector<std::pair<GridCell, std::uint32_t>>;

TEST(Octree, FragmentsGetParents) {
  std::vector<ManifestLevel> levels(3);
  levels[0].fragments = {fragment({0, 0, 0}, 5), fragment({3, 3, 3}, 6), fragment({2, 0, 4}, 7)};
  levels[1].fragments = {fragment({0, 0, 0}, 8)};
  complete_octree(levels);
  EXPECT_EQ(listed(levels[1]), (Listed{{{0, 0, 0}, 8}, {{1, 1, 1}, 0}, {{1, 0, 2}, 0}}));
  EXPECT_EQ(listed(levels[2]), (Listed{{{0, 0, 0}, 0}, {{0, 0, 1}, 0}}));
}

TEST(Octree, HalvesWithTrianglesGetChildren) {
  std::vector<ManifestLevel> levels(2);
  levels[0].fragments = {fragment({2, 0, 0}, 5)};
  levels[1].fragments = {fragment({1, 0, 0}, 6, 0b10000011)};
  complete_octree(levels);
  EXPECT_EQ(listed(levels[0]), (Listed{{{2, 0, 0}, 5}, {{3, 0, 0}, 0}, {{3, 1, 1}, 0}}));
  EXPECT_EQ(listed(levels[1]), (Listed{{{1, 0, 0}, 6}}));
}

TEST(FragmentWelder, MergesEqualPointsAndGrows) {
  FragmentWelder welder;
  for (int round = 0; round < 2; ++round) {
    welder.begin(1);
    for (std::uint16_t i = 0; i < 3000; ++i)
      welder.add(
          {FragmentPoint{i, 0, 0}, {static_cast<std::uint16_t>(i + 1), 0, 0}, {i, 1, 65535}});
    EXPECT_EQ(welder.mesh().triangles.size(), 3000U);
    EXPECT_EQ(welder.mesh().points.size(), 6001U);
    for (std::uint16_t i = 0; i < 3000; ++i) {
      const Triangle& t = welder.mesh().triangles[i];
      EXPECT_EQ(welder.mesh().points[t[0]], (FragmentPoint{i, 0, 0}));
      EXPECT_EQ(welder.mesh().points[t[2]], (FragmentPoint{i, 1, 65535}));
    }
  }
}

}  // namespace
}  // namespace isobrick::test

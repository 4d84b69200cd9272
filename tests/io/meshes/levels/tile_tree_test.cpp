#include "io/meshes/levels/tile_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include "io/meshes/levels/level_fragments.h"
#include "io/meshes/levels/tiles_folder.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {
namespace {

TEST(TileTree, ATileWhoseCellTheFineLevelMissesHasAnEmptyChild) {
  const ChunkGrid grid{.cells = {4, 1, 1}};
  std::vector<EncodedLevel> levels(3);
  const auto at = [](const GridCell& cell) {
    return EncodedFragment{
        .key = z_order_key(cell), .bytes = 1, .halves = 1, .lo = {1, 1, 1}, .hi = {9, 99, 999}};
  };
  levels[0].fragments = {at({0, 0, 0})};
  levels[1].fragments = {at({0, 0, 0}), at({1, 0, 0})};
  levels[1].error = 0.25;
  levels[2].fragments = {at({0, 0, 0})};
  levels[2].error = 1;
  const TemporaryFolder folder;
  TileTree(grid, levels, 2).write(folder / "");
  std::ifstream in(folder / "tileset.json");
  const nlohmann::json root = nlohmann::json::parse(in)["root"];
  EXPECT_NEAR(root["geometricError"].get<double>(), 2, 0.01) << "metres";
  ASSERT_EQ(root["children"].size(), 2U);
  const nlohmann::json &whole = root["children"][0], &missed = root["children"][1];
  EXPECT_EQ(whole["children"][0]["content"]["uri"], "0/0_0_0.glb");
  EXPECT_NEAR(missed["geometricError"].get<double>(), 0.5, 0.01);
  ASSERT_EQ(missed["children"].size(), 1U);
  const nlohmann::json& empty = missed["children"][0];
  EXPECT_EQ(empty["geometricError"], 0.0);
  EXPECT_EQ(empty["boundingVolume"], missed["boundingVolume"]);
  EXPECT_FALSE(empty.contains("content") || empty.contains("children"));
}

TEST(TileBox, HoldsWhatItIsMadeOf) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> number(-1, 1), digits(-6, 3);
  const auto anywhere = [&] { return number(random) * std::pow(10, digits(random)); };
  int rounded = 0;
  for (int round = 0; round < 1000; ++round) {
    MeshBounds bounds;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = anywhere(), b = anywhere();
      bounds.lo[axis] = std::min(a, b);
      bounds.hi[axis] = std::max(a, b);
    }
    const MeshBounds box = TileBox(bounds, 0).bounds();
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(box.lo[axis], bounds.lo[axis]);
      EXPECT_GE(box.hi[axis], bounds.hi[axis]);
      EXPECT_NEAR(box.lo[axis], bounds.lo[axis], 1e-12);
      EXPECT_NEAR(box.hi[axis], bounds.hi[axis], 1e-12);
      rounded += box.lo[axis] != bounds.lo[axis] || box.hi[axis] != bounds.hi[axis];
    }
  }
  EXPECT_GT(rounded, 0);
  const MeshBounds flat = TileBox({{1, 2, 3}, {1, 5, 3}}, 0.5).bounds();
  EXPECT_EQ(flat.hi.x - flat.lo.x, 0.5);
  EXPECT_EQ(flat.hi.y - flat.lo.y, 3);
}

TEST(TilesNames, AreThoseOfItsFiles) {
  for (const char* name : {"tileset.json", "tileset_3_0_12_1.json", "0/1_2_3.glb", "12/0_0_0.glb",
                           "7/tileset.json", "-7/0/1_2_3.glb", "7/tileset_1_2_3_4.json"})
    EXPECT_TRUE(TilesFolder::is_own_name(name)) << name;
  for (const char* name :
       {"", "tileset_.json", "tileset_1_2_3.json", "1_2_3.glb", "x/1_2_3.glb", "0/1_2.glb",
        "0/1_2_3.glb.bak", "-/tileset.json", "0/notes.txt", "1/2/3/1_2_3.glb", "labels.json"})
    EXPECT_FALSE(TilesFolder::is_own_name(name)) << name;
}

}  // namespace
}  // namespace isobrick::test

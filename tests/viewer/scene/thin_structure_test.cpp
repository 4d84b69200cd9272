#include "viewer/scene/thin_structure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/active_of.h"
#include "tests/viewer/scene/perspective.h"
#include "viewer/scene/cut.h"
#include "viewer/scene/node_mesher.h"
#include "viewer/scene/scene.h"

namespace isobrick::test {
namespace {

constexpr Index kEdge = 256;
constexpr double kIsovalue = 128;
/// Rods along z, four samples thick: visible on level 1, not on level 2.
constexpr std::array<Index, 4> kRodsY{30, 94, 158, 222};
constexpr Index kRodsX = 174, kThick = 4;
constexpr std::uint64_t kThinTriangles = 300'000;

/// A ball beside the rods, in the same large parts of the volume.
std::uint8_t only_ball(Int3 p) {
  return p.x < 170 ? static_cast<std::uint8_t>(128 + ball(p, 180) / 3) : 0;
}
std::uint8_t ball_and_rods(Int3 p) {
  if (p.x >= kRodsX && p.x < kRodsX + kThick)
    for (const Index y : kRodsY)
      if (p.y >= y && p.y < y + kThick) return 200;
  return only_ball(p);
}
/// Specks, which no coarse level has.
std::uint8_t specks(Int3 p) {
  const auto hash = static_cast<std::uint64_t>(p.x * 73856093 ^ p.y * 19349663 ^ p.z * 83492791);
  return hash * 0x9e3779b97f4a7c15ULL >> 56 == 0 ? 255 : 20;
}

struct Volume {
  explicit Volume(std::uint8_t (*field)(Int3), Index edge = kEdge)
      : source(std::make_shared<MemoryBricks>(Int3{edge, edge, edge},
                                              std::function<std::uint8_t(Int3)>(field),
                                              MemoryBricks::Options{})),
        tree(*source),
        bricks(source, std::uint64_t{1} << 28) {}

  std::shared_ptr<MemoryBricks> source;
  NodeTree tree;
  ResidentBricks bricks;
};

View from_the_side() {
  View view;
  view.eye = {900, 128, 300};
  view.width = 1280;
  view.height = 800;
  view.view_projection = perspective_view(view.eye, {128, 128, 128}, {0, 0, 1}, 0.6, 1.6, 1, 10000);
  return view;
}

Cut preview(const NodeTree& tree, std::uint64_t triangles, std::uint64_t thin_triangles) {
  return CutSelector(tree).select(active_of(tree, std::vector<double>{kIsovalue}), from_the_side(),
                                  {.triangles = triangles, .thin_triangles = thin_triangles});
}

/// Number of rod segments, 16 samples long, that a vertex of the cut's meshes lies on.
int pieces_shown(Volume& volume, const Cut& cut) {
  NodeMesher mesher(volume.tree.grid(), volume.bricks, {});
  std::array<std::array<bool, kEdge / 16>, kRodsY.size()> shown{};
  for (const CutNode& node : cut.nodes)
    for (const Vec3f p : mesher.mesh(node.key, kIsovalue, node.coarser, Always()).mesh.positions)
      for (std::size_t rod = 0; rod < kRodsY.size(); ++rod)
        if (std::abs(p.x - (kRodsX + 1.5f)) < kThick &&
            std::abs(p.y - (static_cast<float>(kRodsY[rod]) + 1.5f)) < kThick)
          shown[rod][static_cast<std::size_t>(p.z) / 16] = true;
  int pieces = 0;
  for (const auto& rod : shown)
    pieces += static_cast<int>(std::count(rod.begin(), rod.end(), true));
  return pieces;
}
constexpr int kAllPieces = kEdge / 16 * static_cast<int>(kRodsY.size());

TEST(ThinStructure, IsFoundBesideALargeSurface) {
  for (const bool rods : {true, false}) {
    Volume volume(rods ? ball_and_rods : only_ball);
    ThinStructure& thin = volume.tree.thin_structure();
    EXPECT_FALSE(thin.lost({2, {0, 0, 0}}, kIsovalue)) << "it is not known yet";
    ASSERT_TRUE(thin.read(volume.bricks, Always()));
    EXPECT_FALSE(thin.read(volume.bricks, Always())) << "it is known";
    ASSERT_EQ(volume.tree.grid().levels(), 5);
    for (int v = 2; v < 5; ++v) EXPECT_EQ(thin.lost({v, {0, 0, 0}}, kIsovalue), rods) << v;
    EXPECT_FALSE(thin.lost({2, {0, 0, 0}}, 250)) << "nothing has that";
  }
}

TEST(ThinStructure, EveryRodIsInPreviewsOfTheSmallestBudgets) {
  Volume volume(ball_and_rods);
  volume.tree.thin_structure().read(volume.bricks, Always());
  for (const std::uint64_t budget : {0u, 2'000u, 20'000u, 60'000u}) {
    EXPECT_EQ(pieces_shown(volume, preview(volume.tree, budget, 0)), 0) << budget;
    const Cut cut = preview(volume.tree, budget, kThinTriangles);
    EXPECT_EQ(pieces_shown(volume, cut), kAllPieces) << budget;
    EXPECT_GT(cut.triangles, budget);
    EXPECT_LE(cut.triangles, kThinTriangles);
  }
}

TEST(ThinStructure, NeverTakesMoreThanItsLimit) {
  Volume volume(specks);
  volume.tree.thin_structure().read(volume.bricks, Always());
  ASSERT_TRUE(volume.tree.thin_structure().lost({2, {0, 0, 0}}, kIsovalue));
  const std::uint64_t least = preview(volume.tree, 0, 0).triangles;  // of the coarsest level
  for (const std::uint64_t limit : {3'000u, 30'000u, 300'000u, 3'000'000u})
    for (const std::uint64_t budget : {0u, 2'000u, 20'000u, 200'000u, 2'000'000u})
      EXPECT_LE(preview(volume.tree, budget, limit).triangles, std::max({budget, limit, least}))
          << budget << ' ' << limit;
}

/// Nodes that lose nothing keep half of the budget.
TEST(ThinStructure, LeavesAPartOfTheBudgetToAllElse) {
  const auto field = [](Int3 p) -> std::uint8_t {
    if (p.z >= 2 * kEdge / 3) return specks(p);
    return p.z < 40 ? 200 : 20;
  };
  Volume volume(+field);
  volume.tree.thin_structure().read(volume.bricks, Always());
  // Blocks of the cut that the plane crosses.
  const auto plane = [&](std::uint64_t triangles, std::uint64_t thin_triangles) {
    int blocks = 0;
    for (const CutNode& node : preview(volume.tree, triangles, thin_triangles).nodes)
      if (volume.tree.grid().box(node.key).lo.z < 40)
        blocks += volume.tree.active_blocks(node.key, kIsovalue);
    return blocks;
  };
  const int finest = plane(10'000'000, 0);
  EXPECT_GT(finest, plane(10'000, 0));
  for (const std::uint64_t budget : {400'000u, 600'000u, 800'000u})  // half of it is enough
    EXPECT_EQ(plane(budget, 1'000'000), finest) << budget;
}

TEST(ThinStructure, WhatCannotBeReadCountsAsThere) {
  Volume volume(ball_and_rods);
  volume.source->damage(3, {0, 0, 0});  // levels 3 and 4 are made of it
  ThinStructure& thin = volume.tree.thin_structure();
  EXPECT_TRUE(thin.read(volume.bricks, Always()));
  EXPECT_FALSE(thin.lost({3, {0, 0, 0}}, kIsovalue));
  EXPECT_FALSE(thin.lost({4, {0, 0, 0}}, kIsovalue));
  EXPECT_TRUE(thin.lost({2, {0, 0, 0}}, kIsovalue));
}

TEST(ThinStructure, IsReadAgainAfterItWasAbandoned) {
  class AlwaysCancelled final : public CancellationToken {
    void check() const override { throw OperationCancelled(); }
  };
  Volume volume(ball_and_rods);
  ThinStructure& thin = volume.tree.thin_structure();
  EXPECT_THROW(thin.read(volume.bricks, AlwaysCancelled()), OperationCancelled);
  EXPECT_FALSE(thin.known());
  EXPECT_TRUE(thin.read(volume.bricks, Always()));
  EXPECT_TRUE(thin.lost({2, {0, 0, 0}}, kIsovalue));
}

/// After ThinStructure::read() the same request gives another cut.
TEST(ThinStructure, BecomesKnownBesideTheFirstMeshes) {
  Volume volume(ball_and_rods);
  Scene scene(volume.source, {.threads = 1});
  const auto update = [&] {
    scene.update({kIsovalue}, from_the_side(),
                 {.triangles = 20'000, .thin_triangles = kThinTriangles});
  };
  update();
  const std::uint64_t before = scene.cut().triangles;
  for (int i = 0; i < 1000 && !scene.tree().thin_structure().known(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_TRUE(scene.tree().thin_structure().known());
  update();
  EXPECT_GT(scene.cut().triangles, before);
  EXPECT_GT(scene.cut().triangles, 20'000u);
}

}  // namespace
}  // namespace isobrick::test

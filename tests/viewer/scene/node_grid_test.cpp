#include "viewer/scene/node_grid.h"

#include <gtest/gtest.h>

#include "core/box_union.h"
#include "pipeline/convert/downsample.h"
#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "viewer/scene/node_samples.h"
#include "viewer/scene/node_tree.h"

namespace isobrick::test {
namespace {

StoreInfo halved(Int3 extent, int levels) {
  StoreInfo info;
  LevelInfo level;
  level.lattice.extent = extent;
  level.transform.spacing = {0.5, 2, 3};
  level.transform.origin = {10, -4, 7};
  for (int i = 0; i < levels; ++i) {
    info.levels.push_back(level);
    level.transform = coarser_transform(level.transform, level.lattice.extent, kHalveAll);
    level.lattice.extent = coarser_extent(level.lattice.extent, kHalveAll);
  }
  return info;
}

TEST(NodeGrid, PointsOfALevelArePointsOfAllFinerOnes) {
  const NodeGrid grid(halved({300, 201, 130}, 4));
  ASSERT_EQ(grid.coarsest_stored(), 3);
  for (int v = 1; v < grid.levels(); ++v)
    for (int axis = 0; axis < 3; ++axis)
      for (Index p = 0; p <= grid.level(v).cells[axis]; ++p) {
        const Index finer = std::min(grid.ratio(v - 1)[axis] * p, grid.level(v - 1).cells[axis]);
        EXPECT_EQ(grid.position(v, axis, p), grid.position(v - 1, axis, finer));
      }
}

TEST(NodeGrid, ChildrenCoverTheirParentExactly) {
  const NodeGrid grid(halved({300, 201, 130}, 4));
  for (int v = 1; v < grid.levels(); ++v) {
    Index children = 0;
    for_each_point({{0, 0, 0}, grid.level(v).nodes}, [&](Int3 p) {
      const IndexBox box = grid.box({v, p});
      BoxUnion<IndexBox> all;
      for_each_point(grid.children({v, p}), [&](Int3 c) {
        ++children;
        EXPECT_EQ(grid.parent({v - 1, c}), (NodeKey{v, p}));
        all.include(grid.box({v - 1, c}));
      });
      EXPECT_EQ(all.box(), box);
    });
    EXPECT_EQ(children, volume(grid.level(v - 1).nodes));
  }
}

TEST(NodeGrid, StoredSamplesLieWhereTheirTransformsSay) {
  const StoreInfo info = halved({300, 201, 130}, 3);
  const NodeGrid grid(info);
  for (int v = 0; v < 3; ++v)
    for (const Index p : {Index{3}, Index{17}, Index{20}}) {
      Vec3d stored;
      for (int axis = 0; axis < 3; ++axis) {
        const auto between = grid.interpolation(v, axis, p);
        stored[axis] = static_cast<double>(between.first) + between.weight;
        EXPECT_EQ(between.weight > 0, v > 0);
      }
      const auto at = static_cast<double>(p * grid.level(v).step.x);
      const Vec3d a = info.levels[0].transform.apply({at, at, at});
      const Vec3d b = info.levels[static_cast<std::size_t>(v)].transform.apply(stored);
      for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-9);
    }
}

TEST(NodeGrid, AnAxisThatIsNotHalvedKeepsItsStep) {
  StoreInfo info = halved({200, 200, 200}, 1);
  LevelInfo half = info.levels[0];
  half.transform.spacing.x *= 2;
  half.transform.spacing.y *= 2;
  half.lattice.extent = {100, 100, 200};
  info.levels.push_back(half);
  half.transform.spacing = half.transform.spacing * 4;
  half.lattice.extent = {25, 25, 50};
  info.levels.push_back(half);
  const NodeGrid grid(info);
  ASSERT_EQ(grid.coarsest_stored(), 3) << "one between the levels that are four times apart";
  EXPECT_EQ(grid.level(1).step, (Int3{2, 2, 1}));
  EXPECT_EQ(grid.level(1).source, 1);
  EXPECT_EQ(grid.level(2).step, (Int3{4, 4, 2}));
  EXPECT_EQ(grid.level(2).source, 1);
  EXPECT_EQ(grid.level(3).step, (Int3{8, 8, 4}));
  EXPECT_EQ(grid.level(3).source, 2);
  EXPECT_EQ(grid.children({1, {0, 0, 1}}), (Box3{{0, 0, 1}, {2, 2, 2}}));
}

TEST(NodeGrid, LevelsAboveTheCoarsestStoredOneTakeItsSamples) {
  const NodeGrid grid(halved({300, 201, 130}, 2));
  EXPECT_EQ(grid.coarsest_stored(), 1);
  ASSERT_EQ(grid.levels(), 6);
  EXPECT_EQ(grid.level(2).step, (Int3{4, 4, 4}));
  EXPECT_EQ(grid.level(3).step, (Int3{8, 8, 8}));
  EXPECT_EQ(grid.level(4).step, (Int3{16, 16, 16}));
  EXPECT_EQ(grid.level(5).step, (Int3{32, 16, 16})) << "until an axis has few cells";
  EXPECT_EQ(grid.level(5).cells, (Int3{10, 13, 9}));
  for (int v = 1; v < grid.levels(); ++v) EXPECT_EQ(grid.level(v).source, 1);
  EXPECT_EQ(grid.samples({5, {0, 0, 0}}), (Box3{{0, 0, 0}, {150, 101, 65}}));
  EXPECT_EQ(NodeGrid(halved({10, 17, 1}, 1)).levels(), 1);
  EXPECT_EQ(NodeGrid(halved({2048, 2048, 2048}, 1)).levels(), 1) << "too much would be read";
}

TEST(NodeSamples, AreTheStoredOnesWhereGridPointsLieFarApart) {
  const auto source = std::make_shared<MemoryBricks>(
      Int3{150, 140, 37},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(blobs(p, 150)); }),
      MemoryBricks::Options{.brick = 16, .levels = 1});
  const NodeGrid grid(source->info());
  ASSERT_EQ(grid.levels(), 5);
  ResidentBricks bricks(source, 100 << 20);
  NodeSamples samples(grid, bricks);
  GridValues values;
  for (int v = 0; v < grid.levels(); ++v) {
    const Box3 points{{2, 1, 0}, grid.level(v).cells + Int3{1, 1, 1}};
    samples.read(v, points, 0.25, Always(), values);
    const Box3 needed = samples.bricks(v, points);
    for_each_point(points, [&](Int3 p) {
      Int3 sample;
      for (int axis = 0; axis < 3; ++axis) sample[axis] = grid.position(v, axis, p[axis]);
      ASSERT_EQ(values.at(p), static_cast<float>(source->value(0, sample) - 0.25));
      ASSERT_TRUE(needed.contains({sample.x / 16, sample.y / 16, sample.z / 16}));
    });
  }
}

TEST(NodeTree, RangesHoldWhatTheNodesValuesTake) {
  const Index n = 150;
  const MemoryBricks source(
      {n, n, n},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(blobs(p, n)); }), {});
  const NodeTree tree(source);
  const NodeGrid& grid = tree.grid();
  for (int v = 0; v < grid.levels(); ++v)
    for_each_point({{0, 0, 0}, grid.level(v).nodes}, [&](Int3 p) {
      ValueRange<double> exact;
      for_each_point(grid.samples({v, p}),
                     [&](Int3 s) { exact.include(source.value(grid.level(v).source, s)); });
      const ValueRange<float> own = tree.range({v, p}), below = tree.range_below({v, p});
      EXPECT_LE(own.lo, exact.lo);
      EXPECT_GE(own.hi, exact.hi);
      EXPECT_LE(below.lo, own.lo);
      EXPECT_GE(below.hi, own.hi);
      if (v > 0)
        for_each_point(grid.children({v, p}), [&](Int3 c) {
          EXPECT_LE(below.lo, tree.range_below({v - 1, c}).lo);
          EXPECT_GE(below.hi, tree.range_below({v - 1, c}).hi);
        });
    });
}

TEST(NodeTree, CountsNoFewerActiveBlocksThanThereAre) {
  const Index n = 130;
  const MemoryBricks source(
      {n, n, n},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(blobs(p, n)); }), {});
  const NodeTree tree(source);
  const Int3 blocks = source.info().levels[0].lattice.blocks();
  const RangeTable table = source.block_ranges(0, {{0, 0, 0}, blocks});
  for (const double isovalue : {-3.0, 0.0, 0.7, 4.0})
    for_each_point({{0, 0, 0}, tree.grid().level(0).nodes}, [&](Int3 p) {
      int active = 0;
      for_each_point(intersect({p * 4, (p + Int3{1, 1, 1}) * 4}, {{0, 0, 0}, blocks}),
                     [&](Int3 b) { active += table.at(b).stabbed_by(isovalue); });
      EXPECT_GE(tree.active_blocks({0, p}, isovalue), active);
      EXPECT_LE(tree.active_blocks({0, p}, isovalue), 64);
    });
}

TEST(NodeTree, LevelsAboveStoredOnesHaveAsManyBlocksAsTheirOwnCells) {
  const MemoryBricks source({129, 129, 129}, std::function<float(Int3)>([&](Int3 p) {
                              return static_cast<float>((p.x + p.y + p.z) % 2);
                            }),
                            {.levels = 1});
  const NodeTree tree(source);
  ASSERT_EQ(tree.grid().levels(), 4);
  EXPECT_EQ(tree.active_blocks({0, {0, 0, 0}}, 0.5), 64);
  EXPECT_EQ(tree.active_blocks({1, {0, 0, 0}}, 0.5), 64);
  EXPECT_EQ(tree.active_blocks({2, {0, 0, 0}}, 0.5), 8);
  EXPECT_EQ(tree.active_blocks({3, {0, 0, 0}}, 0.5), 1);
}

}  // namespace
}  // namespace isobrick::test

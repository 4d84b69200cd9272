#include <gtest/gtest.h>

#include "bricks/ranges/range_format.h"
#include "pipeline/convert/convert_plan.h"
#include "tests/pipeline/index_fixture.h"

// Bricks, shards and chunks of ranges follow the shape of thin volumes.

namespace isobrick::test {
namespace {

StoreLayout layout_of(Int3 extent, const ConvertOptions& options = {}, bool sparse = false) {
  VolumeInfo info;
  info.extent = extent;
  return plan_layout(info, options, sparse);
}

Int3 brick_of(Int3 extent, const ConvertOptions& options = {}, bool sparse = false) {
  return layout_of(extent, options, sparse).levels[0].lattice.brick;
}

/// Files of all levels, if no brick is absent.
Index files_of(const StoreLayout& layout) {
  Index files = 0;
  for (const LevelInfo& level : layout.levels) {
    files += volume(ceil_div(level.lattice.extent, level.shard));
    for (const Int3 items : {level.lattice.bricks(), level.lattice.blocks()})
      files += volume(ceil_div(items, range_chunk_extent(items)));
  }
  return files;
}

TEST(ConvertThin, BricksFollowTheShape) {
  // Cubes and nearly so as ever.
  for (const Int3 extent : {Int3{512, 512, 512}, Int3{70, 65, 4000}, Int3{64, 64, 93}})
    EXPECT_EQ(brick_of(extent), (Int3{64, 64, 64}));
  EXPECT_EQ(brick_of({1, 1, 67'000'000}), (Int3{1, 1, 262144}));
  EXPECT_EQ(brick_of({1'000'000, 1, 1}), (Int3{262144, 1, 1}));
  EXPECT_EQ(brick_of({4096, 4096, 1}), (Int3{512, 512, 1}));
  EXPECT_EQ(brick_of({1, 1, 1}), (Int3{1, 1, 1}));
  EXPECT_EQ(brick_of({34, 1, 3}), (Int3{64, 1, 4}));
  EXPECT_EQ(brick_of({20, 20, 20}), (Int3{32, 32, 32}));
  EXPECT_EQ(brick_of({20, 20, 10'000}), (Int3{32, 32, 256}));
  // With --brick they stay cubes, but no longer than the volume needs.
  EXPECT_EQ(brick_of({20, 20, 10'000}, {.brick = 64}), (Int3{32, 32, 64}));
  EXPECT_EQ(brick_of({3, 100, 100}, {.brick = 24}), (Int3{4, 24, 24}));
  // Those of sparse volumes lie in chunks of blocks.
  EXPECT_EQ(brick_of({1, 1, 10'000}, {}, true), (Int3{16, 16, 512}));
}

TEST(ConvertThin, FewFiles) {
  EXPECT_LT(files_of(layout_of({1, 1, 67'000'000})), 600);
  EXPECT_LT(files_of(layout_of({1, 1, 1'000'000})), 30);
  EXPECT_LT(files_of(layout_of({1, 1, 1'000'000}, {.brick = 16})), 150);
  EXPECT_LT(files_of(layout_of({67'000'000, 2, 3})), 3000);
  EXPECT_LT(files_of(layout_of({30'000, 30'000, 1})), 300);
  const StoreLayout layout = layout_of({512, 512, 512});
  EXPECT_EQ(layout.levels[0].shard, (Int3{512, 512, 512}));
  EXPECT_EQ(layout_of({100'000, 64, 64}).levels[0].shard, (Int3{32768, 64, 64}));
  EXPECT_EQ(layout_of({100'000, 64, 64}, {.shard = 512}).levels[0].shard, (Int3{512, 64, 64}));
}

TEST(ConvertThin, ChunksOfRanges) {
  for (const Int3 items : {Int3{32, 32, 32}, Int3{1, 1, 1}, Int3{500, 400, 300}, Int3{20, 1, 32}})
    EXPECT_EQ(range_chunk_extent(items), kRangeChunkCube);
  EXPECT_EQ(range_chunk_extent({1, 1, 4'000'000}), (Int3{1, 1, 32768}));
  EXPECT_EQ(range_chunk_extent({256, 256, 1}), (Int3{256, 128, 1}));
  EXPECT_EQ(range_chunk_extent({33, 16, 100}), (Int3{32, 16, 64}));
  EXPECT_EQ(range_chunk_extent({64, 3, 40}), (Int3{64, 8, 64}));
}

class ConvertThinStore : public ::testing::TestWithParam<Int3> {
 protected:
  /// The samples of every level, which must be whole.
  static std::vector<std::vector<std::byte>> levels_of(const std::filesystem::path& path) {
    NoProgress silent;
    const VerifyReport report = verify(path, {.threads = 2}, silent);
    EXPECT_EQ(report.damage_count, 0u) << (report.damages.empty() ? "" : report.damages[0]);
    const StoreReader store(path);
    std::vector<std::vector<std::byte>> levels;
    for (std::size_t i = 0; i < store.info().levels.size(); ++i)
      levels.push_back(samples_of(store, static_cast<int>(i)));
    return levels;
  }

  TemporaryFolder folder_;
};

TEST_P(ConvertThinStore, SamplesMeshAndRangesAreThoseOfCubes) {
  MemorySource source = make_source<std::uint16_t>(GetParam(), 3);
  convert_quietly(source, folder_ / "thin", {.threads = 2});
  convert_quietly(source, folder_ / "cubes", {.brick = 16, .shard = 64, .threads = 2});
  const auto thin = levels_of(folder_ / "thin"), cubes = levels_of(folder_ / "cubes");
  ASSERT_LE(thin.size(), cubes.size());
  EXPECT_TRUE(std::equal(thin.begin(), thin.end(), cubes.begin()));
  EXPECT_EQ(mesh_of(folder_ / "thin", {.isovalue = 30000}, std::nullopt),
            mesh_of(folder_ / "cubes", {.isovalue = 30000}, std::nullopt));
  const StoreReader a(folder_ / "thin"), b(folder_ / "cubes");
  const Box3 blocks{{0, 0, 0}, a.info().levels[0].lattice.blocks()};
  EXPECT_EQ(a.block_ranges(0, blocks).ranges, b.block_ranges(0, blocks).ranges);
  add_index_quietly(folder_ / "thin", {.kind = IndexKind::octree, .leaf = 4});
  EXPECT_EQ(mesh_of(folder_ / "thin", {.isovalue = 30000}, IndexKind::octree),
            mesh_of(folder_ / "cubes", {.isovalue = 30000}, std::nullopt));
  EXPECT_EQ(verify_quietly(folder_ / "thin").damage_count, 0u);
}

TEST_P(ConvertThinStore, AResumeWritesTheSame) {
  MemorySource source = make_source<std::uint16_t>(GetParam(), 3);
  convert_quietly(source, folder_ / "whole", {.threads = 2});
  const auto expected = tree_of(folder_ / "whole");
  for (const int steps : {0, 1, 2}) {
    Stopping progress("convert", steps);
    MemorySource again = source;
    try {
      convert(again, folder_ / "resumed", {.threads = 2}, progress);
    } catch (const Error&) {
      convert_quietly(again, folder_ / "resumed", {.threads = 2, .resume = true});
    }
    EXPECT_TRUE(tree_of(folder_ / "resumed") == expected) << steps;
    std::filesystem::remove_all(folder_ / "resumed");
  }
}

TEST_P(ConvertThinStore, ASmallBudgetAndAStreamWriteTheSame) {
  MemorySource source = make_source<std::uint16_t>(GetParam(), 3);
  convert_quietly(source, folder_ / "whole", {.threads = 2});
  convert_quietly(source, folder_ / "small", {.memory = std::uint64_t{26} << 20, .threads = 2});
  MemorySource stream(GetParam(), ScalarType::u16, source.samples(), false);
  convert_quietly(stream, folder_ / "stream", {.threads = 2});
  EXPECT_TRUE(tree_of(folder_ / "small") == tree_of(folder_ / "whole"));
  EXPECT_TRUE(tree_of(folder_ / "stream") == tree_of(folder_ / "whole"));
}

INSTANTIATE_TEST_SUITE_P(Shapes, ConvertThinStore,
                         ::testing::Values(Int3{1, 1, 300'000}, Int3{3, 2, 70'000},
                                           Int3{40'000, 3, 2}, Int3{700, 600, 1},
                                           Int3{20, 9, 3000}));

}  // namespace
}  // namespace isobrick::test

#include "pipeline/convert/store_source.h"

#include <gtest/gtest.h>

#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

/// A volume of which some bricks are the fill value, which is not zero.
MemorySource half_empty() {
  const Int3 extent{70, 50, 40};
  auto samples = make_samples<float>(extent, 4);
  for (float& v : samples) v = v < 0 ? -2.5f : v;
  for_each_point({{0, 0, 0}, {48, 32, 32}}, [&](Int3 p) {
    samples[static_cast<std::size_t>(linear_index(p, extent))] = -2.5f;
  });
  MemorySource source(extent, ScalarType::f32, as_bytes(samples));
  source.mutable_info().fill_value = -2.5;
  source.mutable_info().grid_class = "level set";
  return source;
}

TEST(StoreSource, AStoreOfAStoreIsThatStore) {
  TemporaryFolder folder;
  MemorySource source = half_empty();
  const ConvertOptions options{.brick = 16, .shard = 32};
  const auto first = folder / "memory";  // the name of what it is made of
  const ConvertReport made = convert_quietly(source, first, options);
  ASSERT_GT(made.bricks_absent, 10u);
  const auto copied = open_store_source(first.string(), {}, 2);
  EXPECT_EQ(copied->info().fill_value, -2.5);
  EXPECT_EQ(copied->info().grid_class, "level set");
  const ConvertReport report = convert_quietly(*copied, folder / "b", options);
  EXPECT_EQ(report.bricks_absent, made.bricks_absent);
  EXPECT_EQ(tree_of(folder / "b"), tree_of(first));
}

TEST(StoreSource, ItsMemoryCountsTheIndicesOfShards) {
  TemporaryFolder folder;
  MemorySource source = half_empty();
  convert_quietly(source, folder / "a", {.brick = 16, .shard = 32});
  const StoreReader store(folder / "a");
  const LevelInfo& level = store.info().levels.front();
  // 3 × 2 × 2 shards of 8 bricks with 16 bytes each.
  EXPECT_GE(level.index_bytes, 12u * 8 * 16);
  EXPECT_LT(level.index_bytes, 12u * 8 * 16 * 2);
  const std::size_t one = open_store_source((folder / "a").string(), {}, 1)->memory();
  const std::size_t four = open_store_source((folder / "a").string(), {}, 4)->memory();
  EXPECT_EQ(four - one, 3 * 2 * level.lattice.brick_bytes());
  EXPECT_EQ(one, level.index_bytes + 2 * level.lattice.brick_bytes());
}

}  // namespace
}  // namespace isobrick::test

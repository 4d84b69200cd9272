#include <gtest/gtest.h>

#include <thread>

#include "core/surface_range.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

void expect_ranges(const RangeTable& table, const std::vector<std::byte>& pairs, ScalarType type) {
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    ASSERT_EQ(pairs.size(), table.ranges.size() * 2 * sizeof(T));
    for (std::size_t i = 0; i < table.ranges.size(); ++i) {
      ValueRange<T> range;
      std::memcpy(&range, pairs.data() + i * sizeof range, sizeof range);
      const ValueRange<double> expected = surface_range(range);
      ASSERT_EQ(table.ranges[i].lo, expected.lo);
      ASSERT_EQ(table.ranges[i].hi, expected.hi);
    }
  });
}

void expect_round_trip(const std::vector<Level>& levels, Compression compression, double fill) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", levels, compression, fill);
  const StoreReader reader(folder / "a.zarr"), store = reader.native();
  ASSERT_EQ(store.info().levels.size(), levels.size());
  EXPECT_EQ(reader.info().type, surface_type(levels[0].lattice.type));
  EXPECT_EQ(reader.info().stored_type, levels[0].lattice.type);
  EXPECT_EQ(store.info().type, levels[0].lattice.type);
  EXPECT_EQ(store.info().may_have_nan, is_floating(levels[0].lattice.type));
  EXPECT_EQ(store.info().codec, compression.chain().name());
  EXPECT_EQ(fill_bits(store.info().type, store.info().fill_value),
            fill_bits(store.info().type, fill));
  for (int i = 0; i < static_cast<int>(levels.size()); ++i) {
    const Level& level = levels[static_cast<std::size_t>(i)];
    const LevelInfo& info = store.info().levels[static_cast<std::size_t>(i)];
    EXPECT_EQ(info.lattice, level.lattice);
    EXPECT_EQ(info.shard, level.shard);
    EXPECT_EQ(info.transform, level.transform);
    EXPECT_EQ(read_level(store, i), level.samples);
    const Lattice& l = level.lattice;
    expect_ranges(store.brick_ranges(i, {{0, 0, 0}, l.bricks()}), make_ranges(level, l.brick),
                  l.type);
    expect_ranges(store.block_ranges(i, {{0, 0, 0}, l.blocks()}),
                  make_ranges(level, {kBlockEdge, kBlockEdge, kBlockEdge}), l.type);
  }
}

TEST(RoundTrip, EveryTypeAndCodec) {
  for (const ScalarType type : kScalarTypes)
    for (const Compression compression :
         {Compression(std::nullopt), Compression(3), Compression(BrickCodec::packed)})
      for (const bool absent : {false, true})
        expect_round_trip({make_level(type, {37, 41, 53}, 16, 32, 7, absent)}, compression, 7);
}

TEST(RoundTrip, ExtentsThatDivideNothing) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 67, 33}, Int3{131, 1, 17}, Int3{2, 3, 1},
                            Int3{64, 64, 64}, Int3{65, 63, 129}})
    expect_round_trip({make_level(ScalarType::u16, extent, 16, 64, 0, true)}, 1, 0);
}

TEST(RoundTrip, BrickSizes) {
  for (const Index brick : {16, 17, 24, 64, 100, 128, 256})
    expect_round_trip({make_level(ScalarType::u8, {150, 70, 70}, brick, 2 * brick, 0, true)}, 3, 0);
}

TEST(RoundTrip, FloatFillValues) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double fill :
       {0.0, -0.0, 0.1, infinity, -infinity, std::numeric_limits<double>::quiet_NaN()}) {
    expect_round_trip({make_level(ScalarType::f64, {40, 20, 20}, 16, 16, fill, true)}, 3, fill);
    const double nearest = static_cast<double>(static_cast<float>(fill));
    expect_round_trip({make_level(ScalarType::f32, {40, 20, 20}, 16, 16, nearest, true)}, 3,
                      nearest);
  }
}

TEST(RoundTrip, LevelsAndTransform) {
  std::vector<Level> levels = {make_level(ScalarType::i16, {50, 60, 70}, 32, 64, -5, true),
                               make_level(ScalarType::i16, {25, 30, 35}, 16, 16, -5, false)};
  levels[0].transform = {
      {0.1, 1.0 / 3, 1e-9}, {-3.5, 1e12, 0.7}, {0, 1, 0, 0, 0, 1, 1, 0, 0}, "micrometer"};
  levels[1].transform = levels[0].transform;
  levels[1].transform.spacing = levels[0].transform.spacing * 2;
  expect_round_trip(levels, 3, -5);
}

TEST(RoundTrip, MoreOpenShardsThanDescriptorsKept) {
  // Every shard is begun before any is finished.
  const TemporaryFolder folder;
  const std::vector<Level> levels = {make_level(ScalarType::u8, {160, 160, 64}, 16, 16, 0, false)};
  StoreWriter writer(folder / "a.zarr", make_layout(levels, 1, 0), false);
  const Int3 bricks = levels[0].lattice.bricks();
  for_each_point({{0, 0, 0}, bricks}, [&](Int3 b) {
    writer.put(
        0, b, *encode_brick(levels[0].lattice, cut_brick(levels[0], b, 0), 0, CodecChain::ours(1)));
  });
  for_each_point({{0, 0, 0}, bricks}, [&](Int3 s) { writer.finish_shard(0, s); });
  writer.finish(false);
  const StoreReader store(folder / "a.zarr");
  EXPECT_EQ(read_level(store, 0), levels[0].samples);
}

TEST(RoundTrip, PartOfTheRanges) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::f32, {1100, 5, 530}, 16, 64, 0, true);
  write_store(folder / "a.zarr", {level}, 3, 0);
  const StoreReader store(folder / "a.zarr");
  const RangeTable all = store.block_ranges(0, {{0, 0, 0}, level.lattice.blocks()});
  const Box3 box{{30, 0, 31}, {66, 1, 34}};
  const RangeTable part = store.block_ranges(0, box);
  for_each_point(box, [&](Int3 p) { EXPECT_EQ(part.at(p), all.at(p)); });
  EXPECT_THROW(store.block_ranges(0, {{0, 0, 0}, {70, 1, 1}}), UsageError);
}

TEST(RoundTrip, ManyThreadsAtOnce) {
  const TemporaryFolder folder;
  const std::vector<Level> levels = {make_level(ScalarType::u16, {200, 100, 100}, 16, 32, 0, true)};
  {
    StoreWriter writer(folder / "a.zarr", make_layout(levels, 1, 0), false);
    std::vector<std::thread> threads;
    const Int3 shards = shards_of(levels[0]);
    for (Index z = 0; z < shards.z; ++z)
      threads.emplace_back([&, z] {
        for_each_point({{0, 0, z}, {shards.x, shards.y, z + 1}},
                       [&](Int3 s) { write_shard(writer, levels, 0, s, 1, 0); });
      });
    for (std::thread& thread : threads) thread.join();
    writer.finish(false);
  }
  const StoreReader store(folder / "a.zarr");
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&] { EXPECT_EQ(read_level(store, 0), levels[0].samples); });
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace isobrick::test

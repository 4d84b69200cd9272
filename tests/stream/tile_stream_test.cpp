#include "stream/tile_stream.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "core/morton.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

TEST(TileStream, BeginLooksAtOneRangeChunkAndNextGoesOn) {
  // Along x three chunks of ranges, of which only the last has active tiles. The chunks of so thin
  // a volume lie along x.
  constexpr Index kEdge =
      StoreReader::kRangeChunk * StoreReader::kRangeChunk * StoreReader::kRangeChunk * kBlockEdge;
  const Int3 extent{3 * kEdge, 2, 2};
  auto samples = make_samples<std::uint16_t>(extent, 3);
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    auto& sample = samples[static_cast<std::size_t>(linear_index(p, extent))];
    sample = static_cast<std::uint16_t>(sample % 1000 + 1);
    if (p.x > 2 * kEdge && (p.x + p.y) % 2) sample = 5000;
  });
  const TemporaryFolder folder;
  MemorySource source(extent, ScalarType::u16, as_bytes(samples));
  convert_quietly(source, folder / "a", {.brick = 32, .shard = 64});
  const StoreReader store(folder / "a");

  TileStream stream(store, 0, 3000, {{0, 0, 0}, extent});
  stream.begin();
  const std::uint64_t of_one = stream.range_bytes();
  EXPECT_GT(of_one, 0u);
  const auto first = stream.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->tile, (Int3{2 * kEdge / kTileEdge, 0, 0}));
  EXPECT_GE(stream.range_bytes(), 2 * of_one);
  Index tiles = 1;
  while (stream.next()) ++tiles;
  EXPECT_EQ(tiles, kEdge / kTileEdge);
}

struct NoiseStore {
  explicit NoiseStore(Int3 extent) {
    MemorySource source = make_source<std::uint16_t>(extent, 3, true);
    convert_quietly(source, path, {.brick = 32, .shard = 64});
  }

  TemporaryFolder folder;
  std::filesystem::path path = folder / "a";
};

/// Of several isovalues the stream has every tile once, in Morton order, and what each touches.
TEST(TileStream, SeveralIsovaluesShareOneOrder) {
  const NoiseStore noise({150, 90, 530});
  const StoreReader store(noise.path);
  const Box3 roi{{3, 40, 5}, {140, 90, 530}};
  const std::vector<double> isovalues{40000, -1, 20000, 65000};
  TileStream together(store, 0, isovalues, roi);
  std::vector<std::vector<TileWork>> of_each(isovalues.size());
  std::optional<std::uint64_t> before;
  while (const auto work = together.next()) {
    const std::uint64_t code = morton_encode(work->tile);
    EXPECT_TRUE(!before || *before < code);
    before = code;
    int all = 0;
    ASSERT_EQ(together.blocks_of_each().size(), isovalues.size());
    for (std::size_t i = 0; i < isovalues.size(); ++i) {
      const std::uint8_t blocks = together.blocks_of_each()[i];
      if (blocks) of_each[i].push_back({work->tile, blocks});
      all |= blocks;
    }
    EXPECT_EQ(work->active_blocks, all);
    EXPECT_NE(all, 0);
  }
  std::uint64_t range_bytes = 0;
  for (std::size_t i = 0; i < isovalues.size(); ++i) {
    SCOPED_TRACE(isovalues[i]);
    const StoreReader fresh(noise.path);  // one that has kept no ranges
    TileStream alone(fresh, 0, isovalues[i], roi);
    std::size_t count = 0;
    while (const auto work = alone.next()) {
      ASSERT_LT(count, of_each[i].size());
      EXPECT_EQ(of_each[i][count].tile, work->tile);
      EXPECT_EQ(of_each[i][count++].active_blocks, work->active_blocks);
    }
    EXPECT_EQ(count, of_each[i].size());
    range_bytes = alone.range_bytes();
  }
  EXPECT_GT(of_each[0].size(), 10u);
  EXPECT_TRUE(of_each[1].empty());
  EXPECT_EQ(together.range_bytes(), range_bytes) << "ranges are read once";
}

/// A batch has the tiles of each isovalue and the bricks of all.
TEST(TileStream, BatchesOfSeveralIsovalues) {
  const NoiseStore noise({150, 90, 100});
  const StoreReader store(noise.path);
  const Lattice& lattice = store.info().levels[0].lattice;
  TileStream stream(store, 0, std::vector<double>{40000, 20000}, lattice.box());
  BatchPlanner planner(stream, lattice, 1, false, 3, 40);
  std::size_t tiles = 0, of_first = 0, of_second = 0;
  for (TileBatch batch; planner.next(batch);) {
    ASSERT_EQ(batch.tiles_of.size(), 2u);
    EXPECT_LE(batch.tiles.size(), 3u);
    EXPECT_LE(batch.bricks.size(), 40u);
    for (const auto& list : batch.tiles_of)
      for (const TileWork& work : list)
        for_each_needed_box(lattice, work, 1, [&](Box3 box) {
          for_each_point(lattice.bricks_of(box), [&](Int3 b) {
            EXPECT_NE(std::find(batch.bricks.begin(), batch.bricks.end(), b), batch.bricks.end());
          });
        });
    tiles += batch.tiles.size();
    of_first += batch.tiles_of[0].size();
    of_second += batch.tiles_of[1].size();
  }
  EXPECT_GE(tiles, std::max(of_first, of_second));
  EXPECT_LE(tiles, of_first + of_second);
  EXPECT_GT(std::min(of_first, of_second), 0u);
}

/// Batches have the bricks of the tiles' own samples, and no others.
TEST(TileStream, TilesThatAreKnown) {
  const NoiseStore noise({150, 90, 100});
  const StoreReader store(noise.path);
  const Lattice& lattice = store.info().levels[0].lattice;
  const std::vector<TileWork> tiles{{{0, 0, 0}, 0xff}, {{2, 1, 0}, 0xff}, {{4, 2, 3}, 0xff}};
  TileStream stream(tiles);
  EXPECT_EQ(stream.isovalues(), 1u);
  EXPECT_EQ(stream.range_bytes() + stream.index_bytes(), 0u);
  BatchPlanner planner(stream, lattice, kFirstCorners, true, 2, 100);
  std::size_t next = 0;
  for (TileBatch batch; planner.next(batch);) {
    std::set<std::array<Index, 3>> needed, planned;
    for (const TileWork& work : batch.tiles) {
      EXPECT_EQ(work.tile, tiles[next++].tile);
      const Int3 origin = work.tile * kTileEdge;
      const Box3 own{origin, origin + Int3{kTileEdge, kTileEdge, kTileEdge}};
      for_each_point(lattice.bricks_of(intersect(own, lattice.box())), [&](Int3 b) {
        needed.insert({b.x, b.y, b.z});
      });
    }
    for (const Int3 b : batch.bricks) planned.insert({b.x, b.y, b.z});
    EXPECT_EQ(planned, needed);
  }
  EXPECT_EQ(next, tiles.size());
}

}  // namespace
}  // namespace isobrick::test

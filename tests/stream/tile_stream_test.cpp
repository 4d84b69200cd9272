#include "isobrick/stream/tile_stream.h"

#include <gtest/gtest.h>

#include <vector>

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

}  // namespace
}  // namespace isobrick::test

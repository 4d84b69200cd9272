#include "isobrick/stream/brick_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "isobrick/core/morton.h"
#include "isobrick/stream/tile_stream.h"
#include "tests/stream/stored_volume.h"

namespace isobrick::test {
namespace {

class Stream : public StoredVolume {};

TEST_F(Stream, CacheKeepsWhatWasNeededLastAndNoMoreThanItsCapacity) {
  const StoreReader store(path_);
  BrickCache cache(store, 0, 0, 4);
  const std::vector<Int3> first{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}},
      second{{2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
  cache.require(first);
  for (const Int3 b : first) expect_samples(cache, b);
  EXPECT_EQ(cache.find({1, 0, 0}), nullptr) << "absent";
  EXPECT_EQ(cache.reads(), 2u);
  cache.require(second);
  for (const Int3 b : second) expect_samples(cache, b);
  EXPECT_EQ(cache.reads(), 4u);
  cache.require(std::vector<Int3>{{4, 0, 0}, {2, 0, 0}});
  EXPECT_EQ(cache.reads(), 4u) << "both were there";
  cache.require(std::vector<Int3>{{0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {3, 1, 0}});
  cache.require(first);
  for (const Int3 b : first) expect_samples(cache, b);
  EXPECT_GT(cache.reads(), cache.bricks_read());
}

TEST_F(Stream, CacheDropsWhatNoLaterTileNeedsAndReusesItsMemory) {
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  for (const Index reach : {0, 1}) {
    const std::size_t capacity = static_cast<std::size_t>(volume(lattice.bricks()));
    TileStream stream(store, 0, 20000, lattice.box());
    BatchPlanner planner(stream, lattice, reach, false, 1, capacity);
    BrickCache cache(store, 0, reach, capacity), keeps_all(store, 0, reach, capacity);
    std::set<const std::byte*> places, all_places;
    TileBatch batch;
    while (planner.next(batch)) {
      cache.drop_before(morton_encode(batch.tiles.front().tile));
      cache.require(batch.bricks);
      keeps_all.require(batch.bricks);
      for (const Int3 b : batch.bricks) {
        expect_samples(cache, b);
        places.insert(cache.find(b));
        all_places.insert(keeps_all.find(b));
      }
    }
    // Nothing is read twice.
    EXPECT_EQ(cache.reads(), keeps_all.reads());
    EXPECT_EQ(cache.bricks_read(), cache.reads());
    EXPECT_LT(places.size(), all_places.size());
  }
}

TEST_F(Stream, BatchesHoldEveryActiveTileOnceInMortonOrderWithItsBricks) {
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  const std::vector<Int3> expected = active_tiles(store, 20000);
  ASSERT_GT(expected.size(), 20u);
  for (const Index reach : {0, 1}) {
    const std::size_t least = max_bricks_of_tile(lattice, reach);
    for (const std::size_t bricks : {least, least + 5, std::size_t{1000}})
      for (const std::size_t tiles : {1, 7, 1000}) {
        TileStream stream(store, 0, 20000, lattice.box());
        BatchPlanner planner(stream, lattice, reach, false, tiles, bricks);
        TileBatch batch;
        std::vector<Int3> found;
        while (planner.next(batch)) {
          EXPECT_LE(batch.tiles.size(), tiles);
          EXPECT_LE(batch.bricks.size(), bricks);
          for (const TileWork& work : batch.tiles) {
            found.push_back(work.tile);
            for_each_needed_box(lattice, work, reach, [&](Box3 box) {
              for_each_point(box, [&](Int3 p) {
                const Int3 b{p.x / 32, p.y / 32, p.z / 32};
                ASSERT_NE(std::find(batch.bricks.begin(), batch.bricks.end(), b),
                          batch.bricks.end());
              });
            });
          }
        }
        EXPECT_EQ(found, expected);
      }
  }
}

}  // namespace
}  // namespace isobrick::test

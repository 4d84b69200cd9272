#include "stream/brick_cache.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <fstream>
#include <set>

#include <isobrick/error.h>
#include "stream/tile_stream.h"
#include "tests/stream/stored_volume.h"

namespace isobrick::test {
namespace {

class Stream : public StoredVolume {};

/// Bricks for a tile after which all of the volume is still to come.
constexpr Int3 kFirstTile{0, 0, 0};

TEST_F(Stream, CacheKeepsWhatIsNeededNextAndNoMoreThanItsCapacity) {
  const StoreReader store(path_);
  BrickCache cache(store, 0, 0, 4);
  const std::vector<Int3> first{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}},
      second{{2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
  const auto expect_all = [&](const std::vector<Int3>& bricks) {
    const auto cached = cache.begin(bricks, kFirstTile);
    cached->wait();
    for (const Int3 b : bricks) expect_samples(*cached, b);
    return cached->find(bricks[1]);
  };
  EXPECT_EQ(expect_all(first), nullptr) << "absent";
  EXPECT_EQ(cache.reads(), 2u);
  expect_all(second);
  EXPECT_EQ(cache.reads(), 4u);
  expect_all({{4, 0, 0}, {2, 0, 0}});
  EXPECT_EQ(cache.reads(), 4u) << "both were there";
  expect_all({{0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {3, 1, 0}});
  expect_all(first);
  EXPECT_GT(cache.reads(), cache.bricks_read());
}

TEST_F(Stream, CacheDecodesTheNextBricksWhileOthersAreUsed) {
  const StoreReader store(path_);
  BrickCache cache(store, 0, 0, 5);
  const std::vector<Int3> first{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}},
      second{{2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
  auto now = cache.begin(first, kFirstTile);
  now->wait();
  auto next = cache.begin(second, kFirstTile);
  cache.will_need(*next, {{0, 1, 0}, {2, 0, 0}});
  for (const Int3 b : first) expect_samples(*now, b);
  next->wait();
  for (const Int3 b : first) expect_samples(*now, b);
  for (const Int3 b : second) expect_samples(*next, b);
  EXPECT_EQ(now->find({2, 0, 0}), next->find({2, 0, 0}));
  now.reset();
  for (const Int3 b : second) expect_samples(*next, b);
  EXPECT_EQ(cache.reads(), cache.bricks_read());
}

TEST_F(Stream, CacheGivesUpBricksThatNobodyWaitsFor) {
  const StoreReader store(path_);
  const std::vector<Int3> bricks{{0, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
  const auto decoded = [&] { return store.brick_times().bytes_decoded; };
  // With one thread nothing is done before somebody waits.
  tbb::task_arena(1).execute([&] {
    BrickCache cache(store, 0, 0, 4);
    { const auto begun = cache.begin(bricks, kFirstTile); }
    EXPECT_EQ(decoded(), 0u);
  });
  tbb::task_arena(1).execute([&] {
    BrickCache cache(store, 0, 0, 4);
    const auto begun = cache.begin(bricks, kFirstTile);
    EXPECT_EQ(decoded(), 0u);
    begun->wait();
    EXPECT_GT(decoded(), 0u);
  });
}

TEST_F(Stream, CacheSaysWhichBrickIsDamaged) {
  {
    const StoreReader store(path_);
    const auto place = store.locate(0, {3, 0, 0});
    ASSERT_TRUE(place);
    std::fstream file(path_ / place->key, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(place->offset + place->size / 2));
    file.put('x').put('y').put('z');
  }
  const StoreReader store(path_);
  BrickCache cache(store, 0, 0, 4);
  const auto whole = cache.begin(std::vector<Int3>{{2, 0, 0}}, kFirstTile);
  const auto damaged = cache.begin(std::vector<Int3>{{2, 0, 0}, {3, 0, 0}}, kFirstTile);
  whole->wait();
  try {
    damaged->wait();
    FAIL() << "no error";
  } catch (const DamageError& e) {
    EXPECT_NE(std::string(e.what()).find("(3, 0, 0)"), std::string::npos) << e.what();
  }
  expect_samples(*whole, {2, 0, 0});
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
      const auto cached = cache.begin(batch.bricks, batch.tiles.back().tile);
      const auto kept = keeps_all.begin(batch.bricks, kFirstTile);
      cached->wait();
      kept->wait();
      for (const Int3 b : batch.bricks) {
        expect_samples(*cached, b);
        places.insert(cached->find(b));
        all_places.insert(kept->find(b));
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

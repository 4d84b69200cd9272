#include "isobrick/stream/brick_cache.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "isobrick/pipeline/convert.h"
#include "isobrick/stream/tile_stream.h"
#include "tests/pipeline/convert_doubles.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Stream : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::temp_directory_path() / ("isobrick-stream-" + std::to_string(::getpid()) + ".zarr");
    fs::remove_all(path_);
    samples_ = make_samples<std::uint16_t>(extent_, 5);
    // One brick that equals the fill value, hence absent.
    for_each_point({{32, 0, 0}, {64, 32, 32}}, [&](Int3 p) { samples_[index(p)] = 0; });
    MemorySource source(extent_, ScalarType::u16, as_bytes(samples_));
    NoProgress silent;
    convert(source, path_, {.brick = 32, .shard = 64}, silent);
  }
  void TearDown() override { fs::remove_all(path_); }

  std::size_t index(Int3 p) const { return static_cast<std::size_t>(linear_index(p, extent_)); }

  void expect_samples(const BrickCache& cache, Int3 brick) const {
    const auto* found = reinterpret_cast<const std::uint16_t*>(cache.find(brick));
    const Lattice lattice{extent_, {32, 32, 32}, ScalarType::u16};
    for_each_point(lattice.brick_box(brick), [&](Int3 p) {
      const Int3 local = p - brick * lattice.brick;
      ASSERT_EQ(found ? found[linear_index(local, lattice.brick)] : 0, samples_[index(p)]);
    });
  }

  Int3 extent_{150, 100, 70};
  fs::path path_;
  std::vector<std::uint16_t> samples_;
};

TEST_F(Stream, CacheKeepsWhatWasNeededLastAndNoMoreThanItsCapacity) {
  const StoreReader store(path_);
  BrickCache cache(store, 0, 4);
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

TEST_F(Stream, BatchesHoldEveryActiveTileOnceInMortonOrderWithItsBricks) {
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  std::vector<Int3> expected;
  TileStream all(store, 0, 20000, lattice.box());
  while (const auto work = all.next()) expected.push_back(work->tile);
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

#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include "stream/tile_stream.h"
#include "tests/pipeline/convert_doubles.h"

namespace isobrick::test {

/// A store of noise in bricks of 32³, one of them absent, and its samples.
class StoredVolume : public ::testing::Test {
 protected:
  void SetUp() override {
    namespace fs = std::filesystem;
    path_ = fs::temp_directory_path() / ("isobrick-stream-" + std::to_string(::getpid()) + ".zarr");
    fs::remove_all(path_);
    samples_ = make_samples<std::uint16_t>(extent_, 5);
    // One brick that equals the fill value, hence absent.
    for_each_point({{32, 0, 0}, {64, 32, 32}}, [&](Int3 p) { samples_[index(p)] = 0; });
    make_store(BrickCodec::zstd);
  }
  void make_store(BrickCodec codec) {
    MemorySource source(extent_, ScalarType::u16, as_bytes(samples_));
    NoProgress silent;
    convert(source, path_, {.brick = 32, .shard = 64, .codec = codec, .force = true}, silent);
  }
  void TearDown() override { std::filesystem::remove_all(path_); }

  std::size_t index(Int3 p) const { return static_cast<std::size_t>(linear_index(p, extent_)); }

  void expect_samples(const BrickLookup& bricks, Int3 brick) const {
    const auto* found = reinterpret_cast<const std::uint16_t*>(bricks.find(brick));
    const Lattice lattice{extent_, {32, 32, 32}, ScalarType::u16};
    for_each_point(lattice.brick_box(brick), [&](Int3 p) {
      const Int3 local = p - brick * lattice.brick;
      ASSERT_EQ(found ? found[linear_index(local, lattice.brick)] : 0, samples_[index(p)]);
    });
  }

  /// Tiles of level 0 that an isovalue touches, in their order.
  static std::vector<Int3> active_tiles(const StoreReader& store, double isovalue) {
    std::vector<Int3> tiles;
    TileStream all(store, 0, isovalue, store.info().levels[0].lattice.box());
    while (const auto work = all.next()) tiles.push_back(work->tile);
    return tiles;
  }

  Int3 extent_{150, 100, 70};
  std::filesystem::path path_;
  std::vector<std::uint16_t> samples_;
};

}  // namespace isobrick::test

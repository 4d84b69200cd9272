#include <gtest/gtest.h>

#include <bit>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/shard_index.h"
#include "tests/bricks/store_fixture.h"

// Stores as others write them: plain chunks, other codecs, other byte orders.

namespace isobrick::test {
namespace {

void append(std::string& to, std::span<const std::byte> bytes) {
  to.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

class Foreign : public testing::Test {
 protected:
  /// 7 × 5 × 4 samples of u16 with values of their own.
  Foreign() {
    level.lattice = {{7, 5, 4}, {3, 2, 2}, ScalarType::u16};
    for (unsigned i = 0; i < 7 * 5 * 4; ++i) {
      level.samples.push_back(static_cast<std::byte>(i));
      level.samples.push_back(static_cast<std::byte>(i / 100 + 1));
    }
    metadata.shape = {4, 5, 7};
    metadata.chunk = {2, 2, 3};
    metadata.type = ScalarType::u16;
    metadata.fill_value = 65535;
    metadata.codecs.zstd_level = 3;
    image.name = "foreign";
    image.levels = {{"s0/image", {}}};
    image.ours = false;
  }

  std::vector<std::byte> encoded_brick(Int3 b) const {
    std::vector<std::byte> brick = cut_brick(level, b, metadata.fill_value);
    if (metadata.codecs.big_endian)
      for (std::size_t i = 0; i < brick.size(); i += 2) std::swap(brick[i], brick[i + 1]);
    return encode_bytes(metadata.codecs, brick);
  }

  void write_metadata() const {
    write_file(path / "zarr.json", to_json(image));
    write_file(path / "s0/image/zarr.json", to_json(metadata));
  }

  void write_chunk(Int3 c, const std::string& bytes) const {
    write_file(path / "s0/image" / metadata.chunk_key(std::array<Index, 3>{c.z, c.y, c.x}), bytes);
  }

  /// A file for each brick.
  void write_plain() const {
    write_metadata();
    for_each_point({{0, 0, 0}, level.lattice.bricks()}, [&](Int3 b) {
      std::string bytes;
      append(bytes, encoded_brick(b));
      write_chunk(b, bytes);
    });
  }

  void expect_readable() const {
    const StoreReader store(path);
    EXPECT_EQ(store.info().levels[0].lattice, level.lattice);
    EXPECT_EQ(read_level(store, 0), level.samples);
    EXPECT_THROW(store.brick_ranges(0, {{0, 0, 0}, {1, 1, 1}}), Error);
  }

  TemporaryFolder folder;
  std::filesystem::path path = folder / "a.zarr";
  Level level;
  ArrayMetadata metadata;
  ImageMetadata image;
};

TEST_F(Foreign, PlainChunksOfAllCodecs) {
  using enum ByteCodec;
  for (const bool big : {false, true})
    for (const std::vector<ByteCodec>& steps :
         {std::vector<ByteCodec>{}, {zstd}, {crc32c}, {zstd, crc32c}, {crc32c, zstd}}) {
      metadata.codecs.big_endian = big;
      metadata.codecs.steps = steps;
      write_plain();
      expect_readable();
    }
}

TEST_F(Foreign, OtherChunkKeys) {
  for (const bool prefix : {false, true})
    for (const char separator : {'.', '/'}) {
      std::filesystem::remove_all(path);
      metadata.key_prefix = prefix;
      metadata.separator = separator;
      write_plain();
      expect_readable();
    }
}

TEST_F(Foreign, AMissingChunkIsFillValue) {
  write_plain();
  std::filesystem::remove(path / "s0/image/c/1/2/0");
  const StoreReader store(path);
  EXPECT_FALSE(store.locate(0, {0, 2, 1}));
  EXPECT_TRUE(store.locate(0, {0, 1, 1}));
  EXPECT_EQ(store.info().fill_value, 65535);
}

TEST_F(Foreign, ShardsWithTheIndexAtTheStartAndGaps) {
  metadata.codecs.steps = {ByteCodec::zstd};
  metadata.chunk = {4, 4, 6};
  metadata.sharding.emplace().brick = {2, 2, 3};
  metadata.sharding->index_at_end = false;
  for (const bool crc : {true, false}) {
    metadata.sharding->index_has_crc = crc;
    write_metadata();
    for_each_point({{0, 0, 0}, {2, 2, 1}}, [&](Int3 s) {
      ShardIndex index(8);
      std::string bytes(ShardIndex::encoded_size(8, crc), '\0');
      for_each_point(intersect({s * 2, s * 2 + Int3{2, 2, 2}}, {{0, 0, 0}, level.lattice.bricks()}),
                     [&](Int3 b) {
                       bytes += "gap";
                       const auto brick = encoded_brick(b);
                       const auto i = static_cast<std::size_t>(linear_index(b - s * 2, {2, 2, 2}));
                       index[i] = {bytes.size(), brick.size()};
                       append(bytes, brick);
                     });
      std::string head;
      append(head, index.encode());
      bytes.replace(0, ShardIndex::encoded_size(8, crc),
                    head.substr(0, ShardIndex::encoded_size(8, crc)));
      write_chunk(s, bytes);
    });
    const StoreReader store(path);
    EXPECT_EQ(store.info().levels[0].shard, (Int3{6, 4, 4}));
    expect_readable();
  }
}

TEST_F(Foreign, AnImpossiblyLongBrickCostsNoMemory) {
  write_plain();
  const std::filesystem::path chunk = path / "s0/image/c/0/0/0";
  std::filesystem::resize_file(chunk, std::uintmax_t{1} << 40);
  const StoreReader store(path);
  std::vector<std::byte> brick(24);
  EXPECT_THROW(store.read_brick(0, {0, 0, 0}, brick.data()), DamageError);
}

TEST_F(Foreign, AnAxisOfAsManySamplesAsAreSupported) {
  metadata.shape = {1, Index{1} << 26, 1};
  write_metadata();
  EXPECT_EQ(StoreReader(path).info().levels[0].lattice.extent.y, Index{1} << 26);
}

TEST_F(Foreign, WhatIsNotSupportedIsNamed) {
  const auto expect = [&](const std::string& part) {
    try {
      StoreReader store(path);
      ADD_FAILURE() << part;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  expect("no store");
  std::filesystem::create_directories(path);
  expect("no zarr.json");
  write_file(path / ".zgroup", "{}");
  expect("no image");
  std::filesystem::remove(path / ".zgroup");
  metadata.shape = {1, 4, 5, 7};
  metadata.chunk = {1, 2, 2, 3};
  write_metadata();
  expect("4 dimensions");
  metadata.shape = {4, 5, 7};
  metadata.chunk = {2, 2, 3};
  using Names = std::vector<std::string>;
  for (const auto& [names, listed] :
       std::vector<std::pair<Names, std::string>>{{{"x", "y", "z"}, "x, y, z"},
                                                  {{"Y", "Z", "X"}, "Y, Z, X"},
                                                  {{"x", "", ""}, "x, (no name), (no name)"},
                                                  {{"x", "y", ""}, "x, y, (no name)"},
                                                  {{"", "y", "z"}, "(no name), y, z"},
                                                  {{"row", "x", "column"}, "row, x, column"}}) {
    metadata.dimension_names = names;
    write_metadata();
    expect("its dimensions are " + listed + ": ");
    expect("only arrays whose last are z, y, x");
  }
  metadata.dimension_names = {"z", "", ""};
  write_metadata();
  EXPECT_NO_THROW(StoreReader{path});
  metadata.dimension_names = {"row", "y", "x"};  // no order follows from it
  write_metadata();
  EXPECT_NO_THROW(StoreReader{path});
  metadata.dimension_names.clear();
  metadata.shape = {Index{1} << 61, 4, 5};
  metadata.chunk = {1, 1, 1};
  write_metadata();
  expect("out of bounds");
  metadata.shape = {Index{1} << 59, 1, 1};
  write_metadata();
  expect("more than 67108864 samples along an axis are not supported");
  metadata.shape = {1, 1, (Index{1} << 26) + 1};
  write_metadata();
  expect("more than 67108864 samples along an axis are not supported");
  metadata.shape = {Index{1} << 26, Index{1} << 26, 64};
  write_metadata();
  expect("too many shards");
}

}  // namespace
}  // namespace isobrick::test

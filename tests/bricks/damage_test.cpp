#include <gtest/gtest.h>

#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

/// Either an error of the given kind or the right samples; never other samples.
bool noticed(const std::filesystem::path& path, const Level& level) {
  try {
    const StoreReader store(path);
    EXPECT_EQ(read_level(store, 0), level.samples);
    return false;
  } catch (const DamageError& e) {
    EXPECT_NE(std::string(e.what()).find("c/0/0/0"), std::string::npos) << e.what();
    return true;
  }
}

TEST(Damage, EveryFlippedByteOfAShard) {
  for (const std::optional<int> zstd_level : {std::optional<int>(), std::optional(3)}) {
    const TemporaryFolder folder;
    const Level level = make_level(ScalarType::u8, {7, 5, 6}, 4, 8, 0, true);
    write_store(folder / "a.zarr", {level}, zstd_level, 0);
    const std::filesystem::path shard = folder / "a.zarr/0/c/0/0/0";
    const std::string whole = read_file(shard);
    for (std::size_t i = 0; i < whole.size(); ++i)
      for (const int flip : {1, 0x80}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        write_file(shard, damaged);
        EXPECT_TRUE(noticed(folder / "a.zarr", level)) << i;
      }
  }
}

TEST(Damage, EveryTruncationOfAShard) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::u16, {7, 5, 6}, 4, 8, 0, true);
  write_store(folder / "a.zarr", {level}, 3, 0);
  const std::filesystem::path shard = folder / "a.zarr/0/c/0/0/0";
  const std::string whole = read_file(shard);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    write_file(shard, whole.substr(0, size));
    EXPECT_TRUE(noticed(folder / "a.zarr", level)) << size;
  }
}

TEST(Damage, TheMessageNamesLevelBrickFileAndOffset) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::u8, {64, 32, 16}, 16, 64, 0, false);
  write_store(folder / "a.zarr", {level}, std::nullopt, 0);
  const std::filesystem::path shard = folder / "a.zarr/0/c/0/0/0";
  std::string bytes = read_file(shard);
  bytes[5000] ^= 1;  // the second brick
  write_file(shard, bytes);
  const StoreReader store(folder / "a.zarr");
  std::vector<std::byte> brick(4096);
  EXPECT_TRUE(store.read_brick(0, {0, 0, 0}, brick.data()));
  const auto place = store.locate(0, {1, 0, 0});
  ASSERT_TRUE(place);
  EXPECT_EQ(place->file, shard);
  EXPECT_EQ(place->offset, 4100u);
  EXPECT_EQ(place->size, 4100u);
  try {
    store.read_brick(0, {1, 0, 0}, brick.data());
    FAIL();
  } catch (const DamageError& e) {
    const std::string message = e.what();
    for (const std::string& part :
         {std::string("level 0"), std::string("brick (1, 0, 0)"), shard.string(),
          std::string("at 4100 + 4100"), std::string("checksum")})
      EXPECT_NE(message.find(part), std::string::npos) << message;
  }
}

TEST(Damage, Ranges) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::f32, {40, 20, 20}, 16, 32, 0, true);
  write_store(folder / "a.zarr", {level}, 3, 0);
  const std::filesystem::path chunk = folder / "a.zarr/isobrick/0/range/c/0/0/0/0";
  const std::string whole = read_file(chunk);
  const Box3 box{{0, 0, 0}, level.lattice.bricks()};
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] ^= 0x10;
    write_file(chunk, damaged);
    EXPECT_THROW(StoreReader(folder / "a.zarr").brick_ranges(0, box), DamageError);
    write_file(chunk, whole.substr(0, i));
    EXPECT_THROW(StoreReader(folder / "a.zarr").brick_ranges(0, box), DamageError);
  }
  std::filesystem::remove(chunk);
  EXPECT_THROW(StoreReader(folder / "a.zarr").brick_ranges(0, box), DamageError);
  std::filesystem::remove_all(folder / "a.zarr/isobrick");
  const StoreReader store(folder / "a.zarr");
  try {
    store.block_ranges(0, {{0, 0, 0}, {1, 1, 1}});
    FAIL();
  } catch (const DamageError&) {
    FAIL() << "a store without ranges is not damaged";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("no ranges"), std::string::npos);
  }
}

TEST(Damage, LevelMetadataMissing) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", {make_level(ScalarType::u8, {4, 4, 4}, 4, 4, 0, false)}, 3, 0);
  std::filesystem::remove(folder / "a.zarr/0/zarr.json");
  EXPECT_THROW(StoreReader(folder / "a.zarr"), DamageError);
}

}  // namespace
}  // namespace isobrick::test

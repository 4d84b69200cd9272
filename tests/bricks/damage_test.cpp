#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include <isobrick/image_metadata.h>
#include "bricks/ranges/stored_ranges.h"
#include "tests/bricks/store_fixture.h"
#include "tests/io/bytes/temp_dir.h"

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
  for (const Compression compression :
       {Compression(std::nullopt), Compression(3), Compression(BrickCodec::packed)}) {
    const TemporaryFolder folder;
    const Level level = make_level(ScalarType::u8, {7, 5, 6}, 4, 8, 0, true);
    write_store(folder / "a.zarr", {level}, compression, 0);
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
  for (const Compression compression : {Compression(3), Compression(BrickCodec::packed)}) {
    const TemporaryFolder folder;
    const Level level = make_level(ScalarType::u16, {7, 5, 6}, 4, 8, 0, true);
    write_store(folder / "a.zarr", {level}, compression, 0);
    const std::filesystem::path shard = folder / "a.zarr/0/c/0/0/0";
    const std::string whole = read_file(shard);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      write_file(shard, whole.substr(0, size));
      EXPECT_TRUE(noticed(folder / "a.zarr", level)) << size;
    }
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
  EXPECT_EQ(place->key, "0/c/0/0/0");
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

// Digits of the spacing, the fill value, a key: whatever is changed is noticed or
// changes nothing that is read.
TEST(Damage, EveryFlippedByteOfTheMetadata) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zarr";
  Level level = make_level(ScalarType::f32, {7, 5, 6}, 4, 8, 0.5, true);
  level.transform = {{0.5, 0.25, 2}, {1, 2, -3}, {0, 1, 0, 0, 0, 1, 1, 0, 0}, "micrometer"};
  write_store(path, {level, level}, 3, 0.5);
  const StoreInfo whole_info = StoreReader(path).info();
  int noticed = 0, named = 0;
  for (const char* name : {"zarr.json", "0/zarr.json", "1/zarr.json"}) {
    const std::string whole = read_file(path / name);
    for (std::size_t i = 0; i < whole.size(); ++i)
      for (const int flip : {1, 0x10}) {
        if (whole[i] == ' ') continue;  // most of it is indentation
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        write_file(path / name, damaged);
        try {
          const StoreReader store(path);
          const StoreInfo& info = store.info();
          ASSERT_EQ(info.levels.size(), 2u);
          for (std::size_t l = 0; l < 2; ++l) {
            ASSERT_EQ(info.levels[l].transform, whole_info.levels[l].transform) << name << i;
            ASSERT_EQ(info.levels[l].lattice, whole_info.levels[l].lattice) << name << i;
            ASSERT_EQ(info.levels[l].shard, whole_info.levels[l].shard) << name << i;
          }
          ASSERT_EQ(info.fill_value, whole_info.fill_value) << name << i;
          ASSERT_EQ(info.may_have_nan, whole_info.may_have_nan) << name << i;
          ASSERT_EQ(info.codec, whole_info.codec) << name << i;
        } catch (const Error& e) {
          ++noticed;
          const std::string message = e.what();
          ASSERT_NE(message.find("zarr.json"), std::string::npos) << message;
          if (message.find("metadata was changed") != std::string::npos) ++named;
        }
      }
    write_file(path / name, whole);
  }
  EXPECT_GT(noticed, 1000);
  EXPECT_GT(named, 500);
}

TEST(Damage, ChangedMetadataIsNamedAndReformattedMetadataIsNot) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zarr", root = path / "zarr.json";
  write_store(path, {make_level(ScalarType::u8, {7, 5, 6}, 4, 8, 0, true)}, 3, 0);
  const nlohmann::json whole = nlohmann::json::parse(read_file(root));
  write_file(root, whole.dump());
  EXPECT_NO_THROW(StoreReader{path});
  const auto expect_changed = [&](const nlohmann::json& json) {
    write_file(root, json.dump());
    try {
      const StoreReader store(path);
      FAIL() << json;
    } catch (const DamageError& e) {
      const std::string message = e.what();
      EXPECT_NE(message.find(root.string()), std::string::npos) << message;
      EXPECT_NE(message.find("metadata was changed"), std::string::npos) << message;
    }
  };
  nlohmann::json changed = whole;
  changed["attributes"]["isobrick"]["may_have_nan"] = true;
  expect_changed(changed);
  changed = whole;
  changed["attributes"]["ome"]["multiscales"][0]["datasets"][0]["coordinateTransformations"][0]
         ["scale"][1] = 2;
  expect_changed(changed);
  changed = whole;
  changed["attributes"]["isobrick"].erase("metadata_crc32c");
  expect_changed(changed);
  changed = whole;
  changed["attributes"].erase("isobrick");
  expect_changed(changed);
  write_file(root, whole.dump());
  nlohmann::json array = nlohmann::json::parse(read_file(path / "0/zarr.json"));
  array["fill_value"] = 1;
  write_file(path / "0/zarr.json", array.dump());
  expect_changed(whole);
}

// Metadata with the right checksum of its wrong values, as an attacker would write it.
TEST(Damage, AHostileShapeIsRefusedAtOnce) {
  using Shape = std::array<Index, 3>;  // z, y, x
  for (const Shape& shape : {Shape{524288, 524288, 524288}, Shape{1, 1 << 29, 1 << 30},
                             Shape{7, 5, 12}, Shape{32, 5, 6}}) {
    const TemporaryFolder folder;
    const std::filesystem::path path = folder / "a.zarr";
    write_store(path, {make_level(ScalarType::u8, {6, 5, 7}, 4, 8, 0, true)}, 3, 0);
    nlohmann::json array = nlohmann::json::parse(read_file(path / "0/zarr.json"));
    array["shape"] = shape;
    write_file(path / "0/zarr.json", array.dump());
    nlohmann::json root = nlohmann::json::parse(read_file(path / "zarr.json"));
    root["attributes"]["isobrick"]["metadata_crc32c"] =
        metadata_checksum(root.dump(), std::array{array.dump()}, "file");
    write_file(path / "zarr.json", root.dump());
    StoredRanges ranges = *read_stored_ranges(*folder_storage(path), "");
    ranges.image_crc32c = root["attributes"]["isobrick"]["metadata_crc32c"].get<std::uint32_t>();
    write_file(path / ranges_file(""), to_json(ranges));
    const auto begin = std::chrono::steady_clock::now();
    try {
      const StoreReader store(path);
      FAIL() << array["shape"];
    } catch (const Error& e) {
      const bool too_long = shape[1] > kMaxAxisSamples;
      EXPECT_EQ(dynamic_cast<const DamageError*>(&e) == nullptr, too_long) << e.what();
      EXPECT_NE(std::string(e.what()).find(too_long ? "67108864" : "range/zarr.json"),
                std::string::npos)
          << e.what();
    }
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  }
}

// What is no file must not be waited for.
TEST(Damage, FifosAndFoldersInPlaceOfFiles) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zarr";
  const Level level = make_level(ScalarType::u8, {6, 5, 7}, 4, 8, 0, false);
  write_store(path, {level}, 3, 0);
  const auto read_all = [&] {
    const StoreReader store(path);
    store.brick_ranges(0, {{0, 0, 0}, level.lattice.bricks()});
    store.block_ranges(0, {{0, 0, 0}, level.lattice.blocks()});
    read_level(store, 0);
  };
  struct Case {
    const char* name;
    const char* missing;  // how it is missed where a folder has its name, which is no object
  };
  for (const auto& [name, missing] :
       {Case{"zarr.json", "is no store: it has no zarr.json"},
        Case{"0/zarr.json", "/0/zarr.json' is missing"},
        Case{"0/c/0/0/0", "/0/c/0/0/0' is missing, but has bricks"},
        Case{"isobrick/0/range/zarr.json", "has no ranges yet"},
        Case{"isobrick/0/range/c/0/0/0/0", "/range/c/0/0/0/0' is missing"},
        Case{"isobrick/0/block_range/zarr.json", "has no ranges yet"},
        Case{"isobrick/0/block_range/c/0/0/0/0", "/block_range/c/0/0/0/0' is missing"}}) {
    const std::filesystem::path file = path / name;
    const std::string whole = read_file(file);
    std::filesystem::remove(file);
    ASSERT_EQ(mkfifo(file.c_str(), 0600), 0);
    const std::string of_fifo = message_of<DamageError>(read_all);
    EXPECT_TRUE(contains(of_fifo, "'" + file.string() + "' is not a regular file")) << of_fifo;
    std::filesystem::remove(file);
    std::filesystem::create_directory(file);
    const std::string of_folder = message_of<Error>(read_all);
    EXPECT_TRUE(contains(of_folder, missing)) << of_folder;
    std::filesystem::remove(file);
    write_file(file, whole);
  }
  EXPECT_NO_THROW(read_all());
  std::filesystem::remove(path / "0/c/0/0/0");
  std::filesystem::create_symlink("/dev/zero", path / "0/c/0/0/0");
  EXPECT_THROW(read_all(), DamageError);
}

}  // namespace
}  // namespace isobrick::test

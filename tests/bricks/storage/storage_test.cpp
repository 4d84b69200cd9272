#include <isobrick/storage.h>

#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "bricks/storage/storage_keys.h"
#include "tests/bricks/storage/storages.h"
#include "tests/bricks/store_fixture.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::test {
namespace {

std::vector<std::string> sorted(std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  return names;
}

std::string text_of(const StoredObject& object, std::uint64_t offset, std::size_t size) {
  std::string text(size, '\0');
  object.read(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

/// Every kind of storage, with the same objects.
class EveryStorage : public testing::TestWithParam<std::string> {
 protected:
  EveryStorage() {
    std::string large(100'000, '\0');
    std::mt19937 random(1);
    for (char& c : large) c = static_cast<char>(random());
    contents = {{"zarr.json", "{}"},
                {"0/zarr.json", "of level 0"},
                {"0/c/0/0/0", large},
                {"0/c/0/0/1", ""},
                {"0-1/x", "before 0/ in the order of bytes"},
                {"isobrick/0/index/octree/index.json", "octree"},
                {"isobrick/0/index/kdtree/index.json", "kdtree"}};
  }
  std::shared_ptr<const Storage> make() { return make_storage(GetParam(), contents, folder / ""); }

  TemporaryFolder folder;
  Contents contents;
};

TEST_P(EveryStorage, ReadsObjectsAndPartsOfThem) {
  const auto storage = make();
  for (const auto& [key, bytes] : contents) {
    const auto object = storage->open(key);
    ASSERT_TRUE(object) << key;
    EXPECT_EQ(object->size(), bytes.size());
    EXPECT_TRUE(text_of(*object, 0, bytes.size()) == bytes) << key;
    EXPECT_EQ(text_of(*object, bytes.size(), 0), "");
    EXPECT_TRUE(object->name().ends_with("/" + key)) << object->name();
    EXPECT_EQ(object->name(), storage->name_of(key));
    object->will_need(0, bytes.size());
  }
  const auto object = storage->open("0/c/0/0/0");
  EXPECT_TRUE(text_of(*object, 99'000, 1000) == contents["0/c/0/0/0"].substr(99'000));
}

TEST_P(EveryStorage, AMissingObjectIsNone) {
  const auto storage = make();
  for (const char* key :
       {"none", "0/none", "0/c/0/0/2", "00", "zarr", "none/zarr.json", "zarr.json/x", "0", "0/c"}) {
    EXPECT_FALSE(storage->open(key)) << key;
    EXPECT_NE(storage->name_of(key), "");
  }
}

TEST_P(EveryStorage, NothingIsReadBeyondAnObject) {
  const auto storage = make();
  for (const char* key : {"zarr.json", "0/c/0/0/0", "0/c/0/0/1"}) {
    const auto object = storage->open(key);
    const std::uint64_t size = object->size();
    for (const auto& [offset, count] :
         {std::pair{size, std::size_t{1}}, {0, size + 1}, {~std::uint64_t{0}, 1}, {size + 1, 1}})
      EXPECT_TRUE(contains(
          message_of<DamageError>([&, o = offset, c = count] { text_of(*object, o, c); }), key));
  }
}

TEST_P(EveryStorage, ListsWhatIsDirectlyBelow) {
  const auto storage = make();
  using Names = std::vector<std::string>;
  EXPECT_EQ(sorted(storage->list("")), (Names{"0", "0-1", "isobrick", "zarr.json"}));
  EXPECT_EQ(sorted(storage->list("0")), (Names{"c", "zarr.json"}));
  EXPECT_EQ(sorted(storage->list("0/c/0/0")), (Names{"0", "1"}));
  EXPECT_EQ(sorted(storage->list("isobrick/0/index")), (Names{"kdtree", "octree"}));
  EXPECT_EQ(storage->list("none"), Names());
  EXPECT_EQ(storage->list("is"), Names());
  EXPECT_EQ(storage->list("zarr.json"), Names());
  EXPECT_EQ(storage->list("zarr.json/x"), Names());
}

TEST_P(EveryStorage, ManyThreadsRead) {
  const auto storage = make();
  const std::string& whole = contents["0/c/0/0/0"];
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (unsigned i = 0; i < 8; ++i)
    threads.emplace_back([&, i] {
      std::mt19937 random(i);
      for (int turn = 0; turn < 200; ++turn) {
        const auto object = storage->open("0/c/0/0/0");
        const std::size_t at = random() % whole.size(), size = random() % (whole.size() - at);
        if (text_of(*object, at, size) != whole.substr(at, size)) ++wrong;
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryStorage, testing::ValuesIn(storage_kinds()),
                         [](const auto& kind) { return kind.param; });

/// A store of two levels, with absent bricks.
class StoreIn : public testing::TestWithParam<std::string> {
 protected:
  StoreIn() {
    levels = {make_level(ScalarType::u16, {40, 33, 37}, 16, 32, 7, true),
              make_level(ScalarType::u16, {20, 17, 19}, 16, 32, 7, true, 2)};
    write_store(folder / "a.zarr", levels, 3, 7);
  }
  std::shared_ptr<const Storage> make(const Contents& contents) const {
    return make_storage(GetParam(), contents, folder / "b");
  }

  TemporaryFolder folder;
  std::vector<Level> levels;
};

TEST_P(StoreIn, IsTheStoreInItsFolder) {
  const StoreReader store(make(contents_of(folder / "a.zarr"))), expected(folder / "a.zarr");
  EXPECT_EQ(store.info().additions, "");
  EXPECT_EQ(store.info().name, store.storage()->name());
  EXPECT_EQ(store.info().metadata_crc32c, expected.info().metadata_crc32c);
  for (int level = 0; level < 2; ++level) {
    EXPECT_TRUE(read_level(store, level) == levels[static_cast<std::size_t>(level)].samples);
    EXPECT_TRUE(store.has_ranges(level));
    const Lattice& lattice = levels[static_cast<std::size_t>(level)].lattice;
    const Box3 bricks{{0, 0, 0}, lattice.bricks()}, blocks{{0, 0, 0}, lattice.blocks()};
    EXPECT_EQ(store.brick_ranges(level, bricks).ranges,
              expected.brick_ranges(level, bricks).ranges);
    EXPECT_EQ(store.block_ranges(level, blocks).ranges,
              expected.block_ranges(level, blocks).ranges);
    store.will_need(level, {0, 0, 0});
  }
  const auto here = store.locate(0, {0, 0, 0}), there = expected.locate(0, {0, 0, 0});
  EXPECT_EQ(here->key, "0/c/0/0/0");
  EXPECT_EQ(here->key, there->key);
  EXPECT_EQ(here->offset, there->offset);
}

TEST_P(StoreIn, DamageNamesObjectAndOffset) {
  Contents contents = contents_of(folder / "a.zarr");
  contents["0/c/0/0/0"][10] = static_cast<char>(contents["0/c/0/0/0"][10] ^ 1);
  const StoreReader store(make(contents));
  const std::string message = message_of<DamageError>([&] { read_level(store, 0); });
  EXPECT_TRUE(contains(message, "'" + store.storage()->name_of("0/c/0/0/0") + "' at 0 + "))
      << message;
}

TEST_P(StoreIn, ALostShardIsNoEmptySpace) {
  Contents contents = contents_of(folder / "a.zarr");
  contents.erase("0/c/0/0/1");
  const StoreReader store(make(contents));
  EXPECT_TRUE(contains(message_of<DamageError>([&] { read_level(store, 0); }),
                       "'" + store.storage()->name_of("0/c/0/0/1") + "' is missing"));
}

TEST_P(StoreIn, WhatIsNoStoreIsNamed) {
  const auto storage = make({{"other.txt", "x"}});
  EXPECT_EQ(message_of<Error>([&] { StoreReader store(storage); }),
            "'" + storage->name() + "' is no store: it has no zarr.json");
}

INSTANTIATE_TEST_SUITE_P(Kinds, StoreIn, testing::ValuesIn(storage_kinds()),
                         [](const auto& kind) { return kind.param; });

TEST(Storage, ReadersOpenFoldersAndZips) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::u8, {20, 20, 20}, 16, 32, 0, false);
  write_store(folder / "a.zarr", {level}, 3, 0);
  write_file(folder / "b.zarr.zip", zip_of(contents_of(folder / "a.zarr")));
  std::filesystem::copy_file(folder / "b.zarr.zip", folder / "without_an_extension");
  for (const char* name : {"a.zarr", "b.zarr.zip", "without_an_extension"}) {
    const StoreReader store(folder / name);
    EXPECT_TRUE(read_level(store, 0) == level.samples) << name;
    EXPECT_EQ(store.storage()->local_path(), folder / name);
  }
  write_file(folder / "c.txt", "text");
  for (const char* name : {"c.txt", "none"})
    EXPECT_TRUE(contains(message_of<Error>([&] { open_storage(folder / name); }), "is no store"));
  EXPECT_TRUE(contains(message_of<Error>([&] { open_storage(folder / std::string(300, 'a')); }),
                       "File name too long"));
}

TEST(Storage, FunctionsForSizeAndReadAreNeeded) {
  StorageFunctions functions;
  EXPECT_THROW(function_storage(functions, "bucket"), UsageError);
  functions.size = [](const std::string&) { return std::nullopt; };
  EXPECT_THROW(function_storage(functions, "bucket"), UsageError);
  functions.read = [](const std::string&, std::uint64_t, std::span<std::byte>) {};
  EXPECT_TRUE(function_storage(functions, "bucket"));
}

TEST(Storage, WhatFunctionsThrowReachesTheReader) {
  StorageFunctions functions;
  functions.size = [](const std::string&) -> std::optional<std::uint64_t> {
    throw Error("the network is down");
  };
  functions.read = [](const std::string&, std::uint64_t, std::span<std::byte>) {};
  const auto storage = function_storage(functions, "bucket");
  EXPECT_EQ(message_of<Error>([&] { StoreReader store(storage); }), "the network is down");
}

// A reader closes the objects that it used long ago, but keeps the indices of their shards.
TEST(Storage, AShardThatVanishesIsMissed) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", {make_level(ScalarType::u8, {192, 192, 192}, 16, 32, 0, false)}, 3,
              0);
  const Contents contents = contents_of(folder / "a.zarr");
  bool is_gone = false;
  StorageFunctions functions;
  functions.size = [&](const std::string& key) -> std::optional<std::uint64_t> {
    const auto found = contents.find(key);
    if (found == contents.end() || (is_gone && key == "0/c/0/0/0")) return std::nullopt;
    return found->second.size();
  };
  functions.read = [&](const std::string& key, std::uint64_t offset, std::span<std::byte> bytes) {
    std::memcpy(bytes.data(), contents.at(key).data() + offset, bytes.size());
  };
  const StoreReader store(function_storage(functions, "bucket"));
  std::vector<std::byte> brick(store.info().levels[0].lattice.brick_bytes());
  ASSERT_TRUE(store.read_brick(0, {0, 0, 0}, brick.data()));
  is_gone = true;
  for_each_point({{1, 0, 0}, {6, 6, 6}},
                 [&](Int3 shard) { store.read_brick(0, shard * 2, brick.data()); });
  const std::string missing = "'" + store.storage()->name_of("0/c/0/0/0") + "' is missing";
  const auto read = [&] { store.read_brick(0, {1, 0, 0}, brick.data()); };
  EXPECT_TRUE(contains(message_of<DamageError>(read), missing));
  const auto hint = [&] { store.will_need(0, {1, 0, 0}); };
  EXPECT_TRUE(contains(message_of<DamageError>(hint), missing));
}

TEST(Storage, LevelsThatDoNotExistAreRefused) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", {make_level(ScalarType::u8, {20, 20, 20}, 16, 32, 0, false)}, 3,
              0);
  const StoreReader store(folder / "a.zarr");
  for (const int level : {-1, 1}) {
    EXPECT_THROW(store.has_ranges(level), UsageError);
    EXPECT_THROW(store.will_need(level, {0, 0, 0}), UsageError);
    EXPECT_THROW(store.block_ranges(level, {{0, 0, 0}, {1, 1, 1}}), UsageError);
  }
}

TEST(Storage, KeysHaveNoEmptyParts) {
  EXPECT_EQ(join_key("", "zarr.json"), "zarr.json");
  EXPECT_EQ(join_key(".", "./zarr.json"), "zarr.json");
  EXPECT_EQ(join_key("a//b/", "c"), "a/b/c");
  EXPECT_EQ(join_key("", ""), "");
}

}  // namespace
}  // namespace isobrick::test

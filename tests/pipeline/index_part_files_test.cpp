#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "bricks/stored_index.h"
#include "pipeline/index/add_ranges.h"
#include "tests/pipeline/index_parts_fixture.h"

// What parts of an index leave: which files are kept, refused and removed.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

using IndexPartFiles = IndexParts;

TEST_F(IndexPartFiles, ThatAreWholeAreKept) {
  const Int3 extent{1100, 40, 40};
  const fs::path store = folder_ / "foreign";
  write_foreign(store, extent, {20, 20, 20}, make_samples<std::uint8_t>(extent, 5));
  const IndexOptions options{.leaf = 4};
  const IndexReport made = make_part(store, options, {1, 2});
  EXPECT_EQ(made.chunks_kept, 0u);
  EXPECT_GT(made.chunks, 0u);
  const fs::path part = parts_of(store) / "octree/1of2";
  const auto files = tree_of(part);
  EXPECT_EQ(files.size(), made.chunks + 1);
  const auto times = [&] {
    std::vector<fs::file_time_type> all;
    for (const auto& [name, bytes] : files) all.push_back(fs::last_write_time(part / name));
    return all;
  };
  const auto before = times();
  EXPECT_EQ(make_part(store, options, {1, 2}).chunks_kept, made.chunks);
  EXPECT_EQ(times(), before);
  // Files that are cut off or changed are made again, and not joined before.
  make_part(store, options, {2, 2});
  for (const auto& [name, bytes] : files)
    for (const bool cut : {true, false}) {
      SCOPED_TRACE(name);
      std::string damaged = cut ? bytes.substr(0, bytes.size() - 9) : bytes;
      if (!cut) damaged[damaged.size() - 3] ^= 1;
      std::ofstream(part / name, std::ios::binary) << damaged;
      EXPECT_NE(refusal([&] { join(store, options, 2); }).find("no whole part 1 of the store"),
                std::string::npos);
      make_part(store, options, {1, 2});
      EXPECT_EQ(tree_of(part), files);
    }
  // A changed range is found by the checksum of all of them.
  std::string damaged = files.at("ranges");
  damaged[100] ^= 1;
  std::ofstream(part / "ranges", std::ios::binary) << damaged;
  EXPECT_NE(refusal([&] { join(store, options, 2); }).find("no whole part 1 "), std::string::npos);
  make_part(store, options, {1, 2});
  EXPECT_EQ(tree_of(part), files);
}

TEST_F(IndexPartFiles, OfAStoreThatHasChangedAreRefused) {
  const Int3 extent{1100, 40, 40};
  auto samples = make_samples<std::uint8_t>(extent, 5);
  for (const Index leaf : {4, 16}) {
    SCOPED_TRACE(leaf);
    const fs::path store = folder_ / "foreign", one = folder_ / "one";
    fs::remove_all(store);
    fs::remove_all(one);
    write_foreign(store, extent, {20, 20, 20}, samples);
    const IndexOptions options{.leaf = leaf};
    make_parts(store, options, 3);
    // Only the last bricks, those of the last part.
    const std::string last = "scale0/image/c/1/1/54";
    auto changed = samples;
    for (Index x = 1080; x < 1100; ++x)
      changed[static_cast<std::size_t>(linear_index({x, 30, 30}, extent))] ^= 0xff;
    write_foreign(one, extent, {20, 20, 20}, changed);
    fs::copy_file(one / last, store / last, fs::copy_options::overwrite_existing);
    EXPECT_NE(refusal([&] { join(store, options, 3); }).find("no whole part 3 of the store"),
              std::string::npos);
    EXPECT_FALSE(fs::exists(store / "isobrick/ranges.json"));
    make_part(store, options, {3, 3});
    join(store, options, 3);
    add_index_quietly(one, options);
    expect_same(tree_of(store), tree_of(one));
    // A chunk that goes or comes is a change, too, and so are metadata.
    const fs::path other = copy(one, "other");
    make_foreign(other);
    make_parts(other, options, 3);
    fs::remove(other / last);
    EXPECT_NE(refusal([&] { join(other, options, 3); }).find("no whole part 3 "),
              std::string::npos);
    make_parts(other, options, 3);
    const fs::path metadata = other / "scale0/image/zarr.json";
    nlohmann::json array = nlohmann::json::parse(content_of(metadata));
    array["fill_value"] = 7;
    std::ofstream(metadata) << array.dump();
    EXPECT_NE(refusal([&] { join(other, options, 3); }).find("no whole parts 1, 2, 3 "),
              std::string::npos);
  }
}

TEST_F(IndexPartFiles, OfAnotherStoreOfOursAreRefused) {
  const Int3 extent{1100, 40, 40};
  const fs::path store = convert_to("s", make_source<std::uint8_t>(extent, 3), {.brick = 32});
  make_parts(store, {.leaf = 4}, 2);
  fs::remove_all(store);
  convert_to("s", make_source<std::uint8_t>(extent, 4), {.brick = 32});
  EXPECT_NE(refusal([&] { join(store, {.leaf = 4}, 2); }).find("no whole parts 1, 2 "),
            std::string::npos);
  make_parts(store, {.leaf = 4}, 2);
  join(store, {.leaf = 4}, 2);
  EXPECT_EQ(verify_quietly(store).damage_count, 0u);
}

TEST_F(IndexPartFiles, AreJoinedOnlyWhenAllAreThere) {
  const Int3 extent{1600, 40, 40};
  const fs::path store = folder_ / "foreign";
  write_foreign(store, extent, {20, 20, 20}, make_samples<std::uint8_t>(extent, 5));
  const IndexOptions options{.leaf = 4};
  make_parts(store, options, 3);
  const auto before = tree_of(store);
  EXPECT_NE(refusal([&] { join(store, options, 4); })
                .find("octree' has no whole parts 1, 2, 3, 4 of the store as it is now; index it "
                      "with the same options and --part 1/4"),
            std::string::npos);
  EXPECT_NE(refusal([&] { join(store, {.leaf = 8}, 3); }).find("parts 1, 2, 3 "),
            std::string::npos);
  fs::remove_all(parts_of(store) / "octree/2of3");
  EXPECT_NE(refusal([&] { join(store, options, 3); }).find("no whole part 2 "), std::string::npos);
  EXPECT_TRUE(tree_of(store).size() == before.size());
  make_part(store, options, {2, 3});
  join(store, options, 3);
  EXPECT_FALSE(fs::exists(parts_of(store)));
}

TEST_F(IndexPartFiles, OfOthersStay) {
  const Int3 extent{600, 40, 40};
  const fs::path store = folder_ / "foreign";
  write_foreign(store, extent, {20, 20, 20}, make_samples<std::uint8_t>(extent, 5));
  make_parts(store, {}, 2);
  make_parts(store, {.kind = IndexKind::kdtree, .leaf = 4}, 2);
  make_part(store, {}, {1, 5});
  join(store, {}, 2);
  EXPECT_FALSE(fs::exists(parts_of(store) / "octree/1of2"));
  EXPECT_TRUE(fs::exists(parts_of(store) / "octree/1of5"));
  join(store, {.kind = IndexKind::kdtree, .leaf = 4}, 2);
  EXPECT_FALSE(fs::exists(parts_of(store) / "kdtree"));
  EXPECT_EQ(verify_quietly(store).damage_count, 0u);
  EXPECT_EQ(stored_index_kinds(StoreReader(store), 0),
            (std::vector<std::string>{"kdtree", "octree"}));
}

/// A chunk is made of the first samples behind it, too.
TEST_F(IndexPartFiles, OfAChunkWhoseNeighbourHasChangedAreRefused) {
  const Int3 extent{1100, 40, 40};
  const fs::path store =
      convert_to("s", make_source<std::uint8_t>(extent, 3), {.brick = 64, .shard = 64});
  make_parts(store, {.leaf = 4}, 4);
  const fs::path behind = store / "0/c/0/0/8";
  fs::last_write_time(behind, fs::last_write_time(behind) + std::chrono::seconds(1));
  EXPECT_NE(refusal([&] { join(store, {.leaf = 4}, 4); }).find("no whole parts 1, 2 of"),
            std::string::npos);
}

/// Wherever a join ended, it goes on.
TEST_F(IndexPartFiles, GoOnWithAnInterruptedJoin) {
  const fs::path store =
      convert_to("s", make_source<std::uint8_t>({1100, 70, 40}, 3), {.brick = 32});
  make_foreign(store);
  for (const bool replaces : {false, true})
    for (const Index leaf : {4, 16}) {
      const IndexOptions options{.leaf = leaf, .force = replaces};
      const fs::path one = copy(store, "one");
      add_index_quietly(one, options);
      const auto files = tree_of(one);
      const std::pair<const char*, int> ends[] = {{"ranges", 0}, {"ranges", 4}, {"index", 0},
                                                  {"index", 1},  {"index", 3},  {"index", 4}};
      for (const auto& [stage, steps] : ends) {
        SCOPED_TRACE(std::string(stage) + " " + std::to_string(steps));
        const fs::path joined = copy(replaces ? one : store, "joined");
        make_parts(joined, options, 3);
        IndexOptions joining = options;
        joining.join = 3;
        Stopping stopping(stage, steps);
        EXPECT_THROW(add_index(joined, joining, stopping), Error);
        join(joined, options, 3);
        expect_same(tree_of(joined), files);
        EXPECT_FALSE(fs::exists(parts_of(joined)));
      }
    }
}

TEST_F(IndexPartFiles, ReplaceAnIndexOnlyWithForce) {
  const Int3 extent{1100, 40, 40};
  auto samples = make_samples<std::uint8_t>(extent, 5);
  const fs::path store = folder_ / "foreign", one = folder_ / "one";
  write_foreign(store, extent, {20, 20, 20}, samples);
  add_index_quietly(store, {.leaf = 4});
  const std::string has = "usage: '" + store.string() + "' has the octree index already; --force";
  EXPECT_EQ(refusal([&] { make_part(store, {.leaf = 4}, {1, 2}); }).find(has), 0u);
  EXPECT_EQ(refusal([&] { make_part(store, {.leaf = 8}, {1, 2}); }).find(has), 0u);
  EXPECT_FALSE(fs::exists(parts_of(store)));
  // Stored ranges and checksums are of other samples now.
  for (auto& v : samples) v = static_cast<std::uint8_t>(v / 2 + 3);
  write_foreign(store, extent, {20, 20, 20}, samples);
  write_foreign(one, extent, {20, 20, 20}, samples);
  add_index_quietly(one, {.leaf = 4});
  const IndexOptions options{.leaf = 4, .force = true};
  make_parts(store, options, 3);
  EXPECT_TRUE(join(store, options, 3).ranges_added);
  expect_same(tree_of(store), tree_of(one));
}

TEST_F(IndexPartFiles, MendADamagedIndexWithForce) {
  const fs::path store =
      convert_to("s", make_source<std::uint8_t>({600, 40, 40}, 3), {.brick = 32});
  for (const Index leaf : {4, 16}) {
    add_index_quietly(store, {.leaf = leaf, .force = true});
    const auto files = tree_of(store);
    const fs::path chunk = store / "isobrick/0/index/octree/c/0/0/0";
    std::string damaged = content_of(chunk);
    damaged[5] ^= 1;
    std::ofstream(chunk, std::ios::binary) << damaged;
    make_parts(store, {.leaf = leaf, .force = true}, 2);
    join(store, {.leaf = leaf, .force = true}, 2);
    expect_same(tree_of(store), files);
  }
}

TEST_F(IndexPartFiles, TakeNoLockAndJoinTakesIt) {
  const fs::path store =
      convert_to("s", make_source<std::uint8_t>({600, 40, 40}, 3), {.brick = 32});
  {
    const UniqueFd lock = lock_store(store);
    make_parts(store, {.leaf = 4}, 2);
    EXPECT_NE(refusal([&] { join(store, {.leaf = 4}, 2); }).find("another process is adding"),
              std::string::npos);
  }
  join(store, {.leaf = 4}, 2);
}

TEST_F(IndexPartFiles, RefuseWhatMakesNoSense) {
  const fs::path store = convert_to("s", make_source<std::uint8_t>({40, 40, 40}, 3), {});
  EXPECT_NE(refusal([&] {
              make_part(store, {}, {3, 2});
            }).find("usage: there is no part 3 of 2"),
            std::string::npos);
  EXPECT_NE(refusal([&] { make_part(store, {}, {0, 2}); }).find("usage: "), std::string::npos);
  EXPECT_NE(refusal([&] { join(store, {}, kMaxParts + 1); }).find("usage: "), std::string::npos);
  EXPECT_NE(refusal([&] {
              add_index_quietly(store, {.part = Part{1, 2}, .join = 2});
            }).find("usage: a part is made or all parts are joined"),
            std::string::npos);
  const fs::path zip = folder_ / "s.zip";
  write_zip(*folder_storage(store), zip);
  EXPECT_NE(refusal([&] { make_part(zip, {}, {1, 2}); }).find("is a zip"), std::string::npos);
  EXPECT_FALSE(fs::exists(parts_of(store)));
}

}  // namespace
}  // namespace isobrick::test

#include "bricks/store_entries.h"

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "bricks/store_layout.h"
#include "bricks/zarr/store_names.h"
#include "io/bytes/leftovers.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class StoreEntriesTest : public testing::Test {
 protected:
  StoreEntriesTest() { write_store(store_, levels_, 3, 3); }

  void put(const std::string& name) const {
    fs::create_directories((store_ / name).parent_path());
    write_file(store_ / name, "x");
  }

  const std::vector<Level> levels_{make_level(ScalarType::u8, {40, 36, 33}, 16, 32, 3, false)};
  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a.zarr";
};

TEST_F(StoreEntriesTest, AStoreIsOurs) {
  EXPECT_EQ(why_not_our_store(store_), "");
  fs::create_directory(folder_ / "empty");
  EXPECT_EQ(why_not_our_store(folder_ / "empty"), "");
  EXPECT_EQ(why_not_our_store(folder_ / "missing"), "it is no folder");
}

TEST_F(StoreEntriesTest, WhatAConversionLeavesBelongsToIt) {
  const std::string spool =
      fs::path(create_temporary_file(store_ / "spool").path).filename().string();
  const std::vector<std::string> left{kConvertJournal,
                                      "zarr.json.tmp",
                                      "0/c/1/1/0.tmp",
                                      "isobrick/0/range.partial/c/0/0/0/0",
                                      "isobrick/0/block_range/c/0/0/0/0.tmp",
                                      "isobrick/0/brick_crc32c.partial/checksums.tmp",
                                      "isobrick/0/histogram/zarr.json",
                                      "isobrick/0/histogram/c/0",
                                      "isobrick/0/histogram.partial/c/0.tmp",
                                      "isobrick/0/index/octree.partial/index.json",
                                      "isobrick/0/index/kdtree.replaced/c/0/0/0"};
  for (const std::string& name : left) put(name);
  // Outside of isobrick/ only beside a conversion's marker.
  EXPECT_NE(why_not_our_store(store_), "");
  write_file(store_ / kLayoutMarker, layout_marker(make_layout(levels_, 3, 3)));
  EXPECT_EQ(why_not_our_store(store_), "");
  EXPECT_TRUE(fs::exists(store_ / spool));
  for (const std::string other : {"spool.partial-thesis.txt", "spool.partial-12-0", "0/c/0/0/9.tmp",
                                  "notes.tmp", "1/zarr.json"}) {
    put(other);
    EXPECT_NE(why_not_our_store(store_), "") << other;
    fs::remove(store_ / other);
  }
  write_file(store_ / kLayoutMarker, "");
  EXPECT_NE(why_not_our_store(store_).find("does not list"), std::string::npos);
}

/// Names as ours are, of what this store does not have.
TEST_F(StoreEntriesTest, OnlyTheLevelsAndChunksThatItHas) {
  for (const std::string name : {"1/zarr.json",
                                 "2024/c/1/1/1",
                                 "7/c/1/1/1",
                                 "0/c/2/0/0",
                                 "0/c/0/2/0",
                                 "0/c/0/0/2",
                                 "0/c/00/0/0",
                                 "0/5.tmp",
                                 "0/zarr.json.tmp",
                                 "0/0/0/0",
                                 "spool",
                                 "spool.partial-thesis.txt",
                                 "isobrick/1/zarr.json",
                                 "isobrick/0/range/c/0/0/1/0",
                                 "isobrick/0/block_range/c/1/0/0/0",
                                 "isobrick/0/range/c/0/0/0/1",
                                 "isobrick/0/brick_crc32c/c/0/0/1",
                                 "isobrick/0/index/octree/c/0/0/1",
                                 "isobrick/0/histogram/c/1",
                                 "isobrick/0/histogram/c/0/0",
                                 "isobrick/0/histogram/checksums"}) {
    put(name);
    EXPECT_NE(why_not_our_store(store_).find("no part of a store"), std::string::npos) << name;
    fs::remove(store_ / name);
    for (fs::path above = fs::path(name).parent_path(); !above.empty(); above = above.parent_path())
      if (fs::is_empty(store_ / above)) fs::remove(store_ / above);
    ASSERT_EQ(why_not_our_store(store_), "") << name;
  }
}

TEST_F(StoreEntriesTest, EverythingElseIsForeign) {
  for (const std::string name :
       {"notes", "0/c/7/8/9.jpg", "0/c/7/8/9/10", "0/c/7/x", "0/d/1", "x/zarr.json", "0/c/77",
        "isobrick/notes.tmp", "isobrick/0/index/btree/index.json", "isobrick/0/ranges/zarr.json",
        ".DS_Store", "c/0/0/0", "isobrick/0/range/c/9/0/0/0/0", ".tmp", "zarr.json.partial"}) {
    put(name);
    const auto found = find_foreign_entry(store_, StoreEntries::of(store_));
    ASSERT_TRUE(found) << name;
    EXPECT_TRUE((name + '/').starts_with(found->string() + '/')) << name << ' ' << *found;
    EXPECT_NE(why_not_our_store(store_).find(found->string()), std::string::npos);
    fs::remove_all(store_ / *found);
  }
  EXPECT_EQ(why_not_our_store(store_), "");
  fs::create_symlink("zarr.json", store_ / "1");
  EXPECT_EQ(find_foreign_entry(store_, StoreEntries::of(store_)), fs::path("1"));
}

TEST_F(StoreEntriesTest, APartOfAStoreHasItsOwnPlace) {
  put("isobrick/0/index/octree/index.json");
  put("isobrick/0/index/octree/c/0/0/0");
  const fs::path index = store_ / "isobrick/0/index/octree";
  const StoreEntries entries = StoreEntries::of(store_);
  check_replaceable(index, entries, "isobrick/0/index/octree");
  EXPECT_THROW(check_replaceable(index, entries, "isobrick/0/range"), UsageError);
  check_replaceable(store_ / "missing", entries, "isobrick/0/range");
  put("isobrick/0/index/octree/notes");
  EXPECT_THROW(check_replaceable(index, entries, "isobrick/0/index/octree"), UsageError);
}

TEST_F(StoreEntriesTest, TheMetadataShowsWhoWroteIt) {
  for (const char* text :
       {"", "{}", "[]", "3", R"({"attributes":{"ome":{}}})", R"({"attributes":3})"}) {
    write_file(store_ / "zarr.json", text);
    EXPECT_NE(why_not_our_store(store_).find("zarr.json"), std::string::npos) << text;
  }
  // A version that this program does not know is ours all the same.
  write_file(store_ / "zarr.json", R"({"attributes":{"isobrick":{"version":99},
    "ome":{"multiscales":[{"datasets":[{}]}]}}})");
  EXPECT_EQ(why_not_our_store(store_), "");
  // Without its levels it is not known what else belongs to it.
  write_file(store_ / "zarr.json", R"({"attributes":{"isobrick":{"version":99}}})");
  EXPECT_NE(why_not_our_store(store_).find("does not list what belongs to it"), std::string::npos);
  fs::remove(store_ / "zarr.json");
  EXPECT_EQ(why_not_our_store(store_), "it has no zarr.json");
}

}  // namespace
}  // namespace isobrick::test

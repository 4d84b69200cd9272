#include "isobrick/bricks/store_entries.h"

#include <gtest/gtest.h>

#include "isobrick/bricks/store_names.h"
#include "isobrick/core/error.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class StoreEntries : public testing::Test {
 protected:
  StoreEntries() {
    write_store(store_, {make_level(ScalarType::u8, {40, 36, 33}, 16, 32, 3, false)}, 3, 3);
  }

  void put(const std::string& name) const {
    fs::create_directories((store_ / name).parent_path());
    write_file(store_ / name, "x");
  }

  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a.zarr";
};

TEST_F(StoreEntries, AStoreIsOurs) {
  EXPECT_EQ(why_not_our_store(store_), "");
  fs::create_directory(folder_ / "empty");
  EXPECT_EQ(why_not_our_store(folder_ / "empty"), "");
  EXPECT_EQ(why_not_our_store(folder_ / "missing"), "it is no folder");
}

TEST_F(StoreEntries, WhatAConversionLeavesBelongsToIt) {
  for (const char* name :
       {kLayoutMarker, kConvertJournal, "zarr.json.tmp", "0/c/7/8/9.tmp",
        "isobrick/0/range.partial/c/0/0/0/0", "isobrick/0/block_range/c/0/0/0/0.tmp",
        "isobrick/0/index/octree.partial/index.json", "isobrick/0/index/kdtree.replaced/c/0/0/0",
        "spool.partial-12-0"})
    put(name);
  EXPECT_EQ(why_not_our_store(store_), "");
}

TEST_F(StoreEntries, EverythingElseIsForeign) {
  for (const std::string name :
       {"notes", "0/c/7/8/9.jpg", "0/c/7/8/9/10", "0/c/7/x", "0/d/1", "x/zarr.json", "0/c/77",
        "isobrick/notes.tmp", "isobrick/0/index/btree/index.json", "isobrick/0/ranges/zarr.json",
        ".DS_Store", "c/0/0/0", "isobrick/0/range/c/9/0/0/0/0", ".tmp", "zarr.json.partial"}) {
    put(name);
    const auto found = find_foreign_entry(store_);
    ASSERT_TRUE(found) << name;
    EXPECT_TRUE((name + '/').starts_with(found->string() + '/')) << name << ' ' << *found;
    EXPECT_NE(why_not_our_store(store_).find(found->string()), std::string::npos);
    fs::remove_all(store_ / *found);
  }
  EXPECT_EQ(why_not_our_store(store_), "");
  fs::create_symlink("zarr.json", store_ / "1");
  EXPECT_EQ(find_foreign_entry(store_), fs::path("1"));
}

TEST_F(StoreEntries, APartOfAStoreHasItsOwnPlace) {
  put("isobrick/0/index/octree/index.json");
  put("isobrick/0/index/octree/c/0/0/0");
  const fs::path index = store_ / "isobrick/0/index/octree";
  check_replaceable(index, "isobrick/0/index/octree");
  EXPECT_THROW(check_replaceable(index, "isobrick/0/range"), UsageError);
  check_replaceable(store_ / "missing", "isobrick/0/range");
  put("isobrick/0/index/octree/notes");
  EXPECT_THROW(check_replaceable(index, "isobrick/0/index/octree"), UsageError);
}

TEST_F(StoreEntries, TheMetadataShowsWhoWroteIt) {
  for (const char* text :
       {"", "{}", "[]", "3", R"({"attributes":{"ome":{}}})", R"({"attributes":3})"}) {
    write_file(store_ / "zarr.json", text);
    EXPECT_NE(why_not_our_store(store_).find("zarr.json"), std::string::npos) << text;
  }
  // A version that this program does not know is ours all the same.
  write_file(store_ / "zarr.json", R"({"attributes":{"isobrick":{"version":99}}})");
  EXPECT_EQ(why_not_our_store(store_), "");
  fs::remove(store_ / "zarr.json");
  EXPECT_EQ(why_not_our_store(store_), "it has no zarr.json");
}

}  // namespace
}  // namespace isobrick::test

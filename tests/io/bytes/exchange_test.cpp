#include "io/bytes/exchange.h"

#include <fcntl.h>
#include <gtest/gtest.h>

#include "temp_dir.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

TEST(Exchange, FoldersChangePlacesEitherWay) {
  for (const auto swap : {exchange, exchange_by_renames}) {
    const TempDir dir;
    fs::create_directory(dir / "a");
    fs::create_directory(dir / "b");
    dir.write("a/x", "new");
    dir.write("b/x", "old");
    swap(AT_FDCWD, dir / "a", dir / "b");
    EXPECT_EQ(dir.read("a/x"), "old");
    EXPECT_EQ(dir.read("b/x"), "new");
    EXPECT_EQ(dir.list(), (Names{"a", "b"}));
  }
}

TEST(Exchange, WhatFailsLeavesBothWhereTheyWere) {
  for (const auto swap : {exchange, exchange_by_renames}) {
    const TempDir dir;
    fs::create_directory(dir / "b");
    dir.write("b/x", "old");
    EXPECT_TRUE(
        contains(message_of<Error>([&] { swap(AT_FDCWD, dir / "a", dir / "b"); }), "exchange"));
    EXPECT_EQ(dir.list(), Names{"b"});
    EXPECT_EQ(dir.read("b/x"), "old");
  }
}

}  // namespace
}  // namespace isobrick

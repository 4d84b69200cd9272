#include <gtest/gtest.h>

#include <set>

#include "tests/bricks/hex.h"
#include "tests/bricks/store_fixture.h"

// The bytes of a tiny store, frozen: whatever changes them changes the format,
// which needs a new version in docs/reference/store_format.md.

namespace isobrick::test {
namespace {

/// 3 × 2 × 1 samples 10 … 15 in bricks of 2³, the last of them padded.
Level tiny_level() {
  Level level{{{3, 2, 1}, {2, 2, 2}, ScalarType::u16}, {4, 4, 4}, {}, {}};
  level.transform = {{0.5, 0.25, 2}, {1, 2, -3}, {0, 1, 0, 0, 0, 1, 1, 0, 0}, "micrometer"};
  for (int i = 0; i < 6; ++i) {
    level.samples.push_back(static_cast<std::byte>(10 + i));
    level.samples.push_back(std::byte{0});
  }
  return level;
}

TEST(Golden, Shard) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", {tiny_level()}, std::nullopt, 7);
  const std::string absent = "ffffffffffffffffffffffffffffffff";
  EXPECT_EQ(hex(read_file(folder / "a.zarr/0/c/0/0/0")),
            // Brick (0, 0, 0): its samples, the padding 7, CRC-32C.
            "0a000b000d000e000700070007000700"
            "4da4d4ee"
            // Brick (1, 0, 0).
            "0c0007000f0007000700070007000700"
            "5b3958d8"
            // The index: offset and length of the 2 × 2 × 2 bricks, CRC-32C.
            "00000000000000001400000000000000"
            "14000000000000001400000000000000" +
                absent + absent + absent + absent + absent + absent + "aae450d1");
}

const std::filesystem::path kGolden = ISOBRICK_GOLDEN "/tiny.zarr";

std::set<std::string> files_of(const std::filesystem::path& root) {
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
    if (!entry.is_directory()) files.insert(std::filesystem::relative(entry.path(), root).string());
  return files;
}

TEST(Golden, WhatIsWritten) {
  const TemporaryFolder folder;
  write_store(folder / "a.zarr", {tiny_level()}, std::nullopt, 7);
  const auto files = files_of(kGolden);
  ASSERT_EQ(files.size(), 15u);
  EXPECT_EQ(files_of(folder / "a.zarr"), files);
  for (const std::string& file : files) {
    // Chunks of ranges are compressed, and zstd may compress better one day: then their checksums
    // are others, too.
    const bool compressed = file.starts_with("isobrick/") && file.find("/c/") != std::string::npos;
    const bool depends = file.ends_with("/checksums") || file.ends_with("/ranges.json");
    const bool same_zstd = read_file(folder / "a.zarr/isobrick/0/range/c/0/0/0/0") ==
                           read_file(kGolden / "isobrick/0/range/c/0/0/0/0");
    if (!compressed && (!depends || same_zstd)) {
      EXPECT_EQ(read_file(folder / "a.zarr" / file), read_file(kGolden / file)) << file;
    }
  }
}

TEST(Golden, WhatWasWrittenIsRead) {
  const StoreReader store(kGolden);
  const Level level = tiny_level();
  const StoreInfo& info = store.info();
  ASSERT_EQ(info.levels.size(), 1u);
  EXPECT_EQ(info.levels[0].lattice, level.lattice);
  EXPECT_EQ(info.levels[0].shard, level.shard);
  EXPECT_EQ(info.levels[0].transform, level.transform);
  EXPECT_EQ(info.fill_value, 7);
  EXPECT_EQ(info.codec, "none");
  EXPECT_EQ(read_level(store, 0), level.samples);
  using Range = ValueRange<double>;
  EXPECT_EQ(store.brick_ranges(0, {{0, 0, 0}, {2, 1, 1}}).ranges,
            (std::vector{Range{10, 15}, Range{12, 15}}));
  EXPECT_EQ(store.block_ranges(0, {{0, 0, 0}, {1, 1, 1}}).ranges, (std::vector{Range{10, 15}}));
}

}  // namespace
}  // namespace isobrick::test

#include <gtest/gtest.h>

#include <fmt/format.h>

#include "bricks/ranges/stored_ranges.h"
#include "bricks/stored_index.h"
#include "tests/bricks/hex.h"
#include "tests/pipeline/index_fixture.h"

// The bytes of tiny indices, frozen: whatever changes them changes the format,
// which needs a new version in docs/reference/store_format.md.

namespace isobrick::test {
namespace {

class IndexGolden : public ::testing::Test {
 protected:
  /// 3 × 2 × 2 samples: two cells with the ranges [10, 15] and [11, 30].
  void SetUp() override {
    const std::vector<std::uint8_t> samples{10, 12, 30, 11, 11, 11, 14, 13, 12, 15, 15, 15};
    MemorySource source({3, 2, 2}, ScalarType::u8, as_bytes(samples));
    convert_quietly(source, store_, {.codec = BrickCodec::none, .levels = 1});
  }

  TemporaryFolder folder_;
  std::filesystem::path store_ = folder_ / "a";
};

TEST_F(IndexGolden, Octree) {
  add_index_quietly(store_, {.kind = IndexKind::octree, .leaf = 1});
  const auto tree = tree_of(store_ / index_folder("", 0, "octree"));
  ASSERT_EQ(tree.size(), 2u);
  // Both checksums depend on how well zstd compresses the ranges.
  const StoredIndex index(StoreReader(store_), 0, "octree");
  EXPECT_EQ(tree.at("index.json"),
            fmt::format(R"({{
  "brick": 64,
  "chunk": 512,
  "crc32c": {},
  "data_type": "uint8",
  "isobrick_index": 2,
  "kind": "octree",
  "leaf": 1,
  "ranges_crc32c": {},
  "shape": [
    2,
    2,
    3
  ],
  "zstd_level": null
}}
)",
                        checksum_of(index.layout()), index.layout().ranges_crc32c));
  const std::string chunk = hex(tree.at("c/0/0/0"));
  EXPECT_EQ(chunk.substr(0, chunk.size() - 8),
            // The directory: an octree of one brick with the range [10, 30], CRC-32C.
            "494253580104000038000000000000000100000001000000"
            "000000000000000001000000010000000100000000000000"
            "0a1e000000000000"
            "01dd10f6"
            // Brick (0, 0, 0): an octree of two cells and their union, CRC-32C.
            "494253580104000038000000000000000200000002000000"
            "000000000000000002000000010000000100000000000000"
            "0a0f0b1e0a1e0000"
            "149274a0"
            // Offset and length of both; then the CRC-32C, which knows the index.
            "00000000000000003c00000000000000"
            "3c000000000000003c00000000000000");
}

TEST_F(IndexGolden, StoredRanges) {
  EXPECT_EQ(to_json(StoredRanges{
                .may_have_nan = false, .image_crc32c = 305419896, .levels = {{1, 2, 3}}}),
            R"({
  "crc32c": 3214801016,
  "image_crc32c": 305419896,
  "isobrick_ranges": 3,
  "levels": [
    {
      "block_range_crc32c": 2,
      "brick_crc32c": 3,
      "range_crc32c": 1
    }
  ],
  "may_have_nan": false
}
)");
}

}  // namespace
}  // namespace isobrick::test

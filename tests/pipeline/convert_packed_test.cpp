#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/verify.h>
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

const ConvertOptions kPacked{.brick = 20, .shard = 40, .codec = BrickCodec::packed, .threads = 2};

TEST(ConvertPacked, IsTheSameStoreButForItsBricks) {
  TemporaryFolder folder;
  MemorySource source = make_source<float>({70, 45, 51}, 5, true);
  convert_quietly(source, folder / "packed", kPacked);
  ConvertOptions options = kPacked;
  options.codec = BrickCodec::zstd;
  convert_quietly(source, folder / "zstd", options);
  const StoreReader a(folder / "packed"), b(folder / "zstd");
  expect_same_levels(a, b);
  EXPECT_EQ(a.info().codec, "packed");
  EXPECT_TRUE(a.info().ours);
  NoProgress progress;
  EXPECT_EQ(verify(folder / "packed", {.threads = 2}, progress).damage_count, 0u);
}

TEST(ConvertPacked, ThreadsChangeNothing) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({70, 50, 83}, 3);
  convert_quietly(source, folder / "whole", kPacked);
  const auto whole = tree_of(folder / "whole");
  ConvertOptions options = kPacked;
  options.threads = 3;
  convert_quietly(source, folder / "threads", options);
  EXPECT_EQ(tree_of(folder / "threads"), whole);
}

TEST(ConvertPacked, ZarrVersion2IsRefused) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 3);
  ConvertOptions options = kPacked;
  options.ome = OmeVersion::v04;
  EXPECT_THROW(convert_quietly(source, folder / "a", options), UsageError);
}

}  // namespace
}  // namespace isobrick::test

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "tests/pipeline/index_parts_fixture.h"

// Parts of an index, made alone and joined: the store of a single call.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

constexpr auto kOneToSeven = {1u, 2u, 3u, 4u, 5u, 6u, 7u};

TEST_F(IndexParts, BecomeTheIndexOfASingleCall) {
  // Chunks along every axis, and several levels.
  const fs::path store =
      convert_to("s", make_source<std::uint8_t>({530, 520, 525}, 3), {.brick = 64});
  expect_same_store(store, {.leaf = 8}, {1, 3, 7});
  expect_same_store(store, {.leaf = 16}, {2});
}

TEST_F(IndexParts, OfEveryKindLeafTypeAndCodec) {
  const Int3 extent{1100, 40, 70};
  const fs::path packed = convert_to("p", make_source<std::uint16_t>(extent, 4),
                                     {.brick = 32, .codec = BrickCodec::packed});
  for (const IndexKind kind : kStoredKinds)
    expect_same_store(packed, {.kind = kind, .leaf = 4}, {3});
  for (const Index leaf : {1, 2, 8, 16}) expect_same_store(packed, {.leaf = leaf}, {2});
  expect_same_store(packed, {.leaf = 8}, kOneToSeven);
  expect_same_store(convert_to("f", make_source<float>(extent, 1, true), {.brick = 48}),
                    {.leaf = 4}, {4});
  expect_same_store(
      convert_to("d", make_source<double>(extent, 2, true), {.codec = BrickCodec::none}),
      {.leaf = 4}, {5});
}

TEST_F(IndexParts, OfImagesOfOthersComputeRanges) {
  const Int3 extent{130, 90, 75};
  const fs::path store = folder_ / "foreign";
  for (const Int3 chunk :
       {Int3{20, 20, 20}, {64, 64, 64}, {16, 48, 32}, {130, 90, 1}, {7, 90, 75}}) {
    SCOPED_TRACE(std::to_string(chunk.x) + ", " + std::to_string(chunk.z));
    fs::remove_all(store);
    write_foreign(store, extent, chunk, make_samples<float>(extent, 5, true));
    expect_same_store(store, {.leaf = 4}, {3});
    expect_same_store(store, {.leaf = 16}, kOneToSeven);
  }
  fs::remove_all(store);
  write_foreign(store, extent, {32, 32, 32}, make_samples<std::int16_t>(extent, 6));
  expect_same_store(store, {.kind = IndexKind::kdtree, .leaf = 1}, {2});
  expect_same_store(store, {}, {61, 1000});  // more parts than bricks
  fs::remove_all(store);
  write_foreign(store, extent, {50, 20, 20}, make_samples<double>(extent, 7, true));
  expect_same_store(store, {.leaf = 2}, kOneToSeven);
}

TEST_F(IndexParts, OfImagesOfOthersWithSeveralLevels) {
  const Int3 extent{1100, 70, 600};
  const fs::path store = convert_to("s", make_source<float>(extent, 3, true), {.brick = 32});
  make_foreign(store);
  ASSERT_FALSE(StoreReader(store).info().ours);
  ASSERT_GT(StoreReader(store).info().levels.size(), 3u);
  expect_same_store(store, {.leaf = 8}, {1, 4, 7});
  expect_same_store(store, {}, {2, 13});
}

/// Nothing but fill values, nothing but NaN, and zeros of both signs.
TEST_F(IndexParts, WithLittleInThem) {
  const Int3 extent{600, 40, 40};
  const fs::path store = folder_ / "foreign";
  std::vector<float> samples(600 * 40 * 40);
  write_foreign(store, extent, {20, 20, 20}, samples);
  expect_same_store(store, {.leaf = 4}, {3});
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = i % 600 < 300 ? std::numeric_limits<float>::quiet_NaN()
                 : i % 3 == 0  ? -0.0f
                               : 0.0f;
  write_foreign(store, extent, {20, 20, 20}, samples);
  expect_same_store(store, {.leaf = 4}, {3});
  for (std::size_t i = 0; i < samples.size(); i += 7) samples[i] = i % 2 == 0 ? -1.0f : -0.0f;
  write_foreign(store, extent, {20, 20, 20}, samples);
  expect_same_store(store, {.leaf = 4}, {3});
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = i % 5 == 0 ? 1.0f : -0.0f;
  write_foreign(store, extent, {20, 20, 20}, samples);
  expect_same_store(store, {.leaf = 4}, {3});
  const fs::path flat = folder_ / "flat";  // without a single cell
  write_foreign(flat, {50, 40, 1}, {20, 20, 1}, make_samples<std::uint8_t>({50, 40, 1}, 3));
  expect_same_store(flat, {.leaf = 4}, {2});
}

TEST_F(IndexParts, WithinASmallBudgetAreTheSame) {
  const Int3 extent{600, 130, 90};
  const fs::path store = folder_ / "foreign";
  write_foreign(store, extent, {32, 32, 32}, make_samples<std::uint8_t>(extent, 5));
  IndexOptions small{.leaf = 4, .memory = std::uint64_t{26} << 20};
  expect_same_store(store, small, {3});
  small.memory = std::uint64_t{2} << 20;
  EXPECT_NE(refusal([&] {
              make_part(store, small, {1, 2});
            }).find("usage: a memory budget"),
            std::string::npos);
  make_parts(store, {}, 2);
  EXPECT_NE(refusal([&] {
              join(store, {.memory = std::uint64_t{2} << 20}, 2);
            }).find("usage: a memory budget"),
            std::string::npos);
  EXPECT_FALSE(StoreReader(store).has_ranges(0));
}

}  // namespace
}  // namespace isobrick::test

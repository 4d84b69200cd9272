#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <string_view>

#include "bricks/zarr/shard_index.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

TEST(Codec, Crc32cOfKnownTexts) {
  EXPECT_EQ(crc32c(bytes_of("123456789")), 0xE3069283u);
  EXPECT_EQ(crc32c(bytes_of("")), 0u);
  EXPECT_EQ(crc32c(std::vector<std::byte>(32)), 0x8A9136AAu);
  EXPECT_EQ(crc32c(std::vector<std::byte>(32, std::byte{0xff})), 0x62A8AB43u);
}

TEST(Codec, AllFillComparesBits) {
  const auto bytes = [](std::vector<float> v) {
    const auto b = std::as_bytes(std::span(v));
    return std::vector<std::byte>(b.begin(), b.end());
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(all_fill(ScalarType::f32, bytes({2, 2, 2}), 2));
  EXPECT_FALSE(all_fill(ScalarType::f32, bytes({2, 2, 3}), 2));
  EXPECT_FALSE(all_fill(ScalarType::f32, bytes({3, 3, 3}), 2));
  EXPECT_TRUE(all_fill(ScalarType::f32, bytes({nan, nan}), std::nan("")));
  EXPECT_FALSE(all_fill(ScalarType::f32, bytes({0.0f, 0.0f}), -0.0));
  EXPECT_FALSE(all_fill(ScalarType::f32, bytes({-0.0f, 0.0f}), -0.0));
  EXPECT_TRUE(all_fill(ScalarType::f32, bytes({-0.0f, -0.0f}), -0.0));
  EXPECT_TRUE(all_fill(ScalarType::f32, bytes({1}), 1));
}

TEST(Codec, FillMustBeOfTheType) {
  EXPECT_THROW(fill_bits(ScalarType::u8, 256), Error);
  EXPECT_THROW(fill_bits(ScalarType::u8, -1), Error);
  EXPECT_THROW(fill_bits(ScalarType::i16, 0.5), Error);
  EXPECT_THROW(fill_bits(ScalarType::u32, std::nan("")), Error);
  EXPECT_EQ(fill_bits(ScalarType::u32, 4294967295.0), 0xffffffffu);
  EXPECT_EQ(fill_bits(ScalarType::i8, -1), 0xffu);
}

TEST(Codec, PaddingIsTheFillValue) {
  const Lattice lattice{{5, 3, 2}, {4, 4, 4}, ScalarType::u8};
  std::vector<std::byte> brick(64, std::byte{1});
  pad_brick(lattice, {1, 0, 0}, 9, brick.data());
  for_each_point({{0, 0, 0}, {4, 4, 4}}, [&](Int3 p) {
    const bool inside = p.x < 1 && p.y < 3 && p.z < 2;
    EXPECT_EQ(brick[static_cast<std::size_t>(linear_index(p, {4, 4, 4}))],
              inside ? std::byte{1} : std::byte{9});
  });
}

/// Samples that are no brick, as if they were one.
Lattice brick_of(std::span<const std::byte> samples) {
  const Int3 extent{static_cast<Index>(samples.size()), 1, 1};
  return {extent, extent, ScalarType::u8};
}

TEST(Codec, DecodesWhatItEncodes) {
  std::vector<std::byte> samples(5000);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<std::byte>(i * i >> 5);
  for (const std::optional<int> level :
       {std::optional<int>(), std::optional(1), std::optional(19)}) {
    const auto encoded = encode_brick(brick_of(samples), samples, 0, CodecChain::ours(level));
    ASSERT_TRUE(encoded);
    std::vector<std::byte> decoded(samples.size());
    decode_bytes(CodecChain::ours(level), 1, *encoded, decoded);
    EXPECT_EQ(decoded, samples);
    // Neither more nor fewer samples than there are.
    decoded.resize(samples.size() + 1);
    EXPECT_THROW(decode_bytes(CodecChain::ours(level), 1, *encoded, decoded), DamageError);
    decoded.resize(samples.size() - 1);
    EXPECT_THROW(decode_bytes(CodecChain::ours(level), 1, *encoded, decoded), DamageError);
  }
}

TEST(Codec, OtherOrdersOfSteps) {
  std::vector<std::byte> samples(3000, std::byte{7});
  samples[100] = std::byte{1};
  using enum ByteCodec;
  for (const std::vector<ByteCodec>& steps : {std::vector<ByteCodec>{},
                                              {zstd},
                                              {crc32c},
                                              {crc32c, zstd},
                                              {zstd, zstd, crc32c},
                                              {crc32c, zstd, crc32c, crc32c}}) {
    CodecChain chain;
    chain.steps = steps;
    chain.zstd_level = 3;
    std::vector<std::byte> decoded(samples.size());
    decode_bytes(chain, 1, encode_bytes(chain, samples), decoded);
    EXPECT_EQ(decoded, samples);
  }
}

TEST(Codec, BigEndianIsSwapped) {
  CodecChain chain;
  chain.big_endian = true;
  std::vector<std::uint32_t> out(2);
  decode_bytes(chain, 4, bytes_of(std::string_view("\x01\x02\x03\x04\x00\x00\x00\x05", 8)),
               std::as_writable_bytes(std::span(out)));
  EXPECT_EQ(out, (std::vector<std::uint32_t>{0x01020304, 5}));
}

TEST(Codec, EveryTruncationIsNoticed) {
  const std::vector<std::byte> samples(4096, std::byte{3});
  for (const std::optional<int> level : {std::optional<int>(), std::optional(3)}) {
    const auto encoded = *encode_brick(brick_of(samples), samples, 0, CodecChain::ours(level));
    std::vector<std::byte> decoded(samples.size());
    for (std::size_t size = 0; size < encoded.size(); ++size)
      EXPECT_THROW(
          decode_bytes(CodecChain::ours(level), 1, std::span(encoded).first(size), decoded),
          DamageError);
  }
}

TEST(ShardIndex, ChecksItsEntries) {
  ShardIndex index(3);
  index[0] = {0, 10};
  index[2] = {10, 5};
  const auto bytes = index.encode();
  EXPECT_EQ(bytes.size(), 3 * 16 + 4u);
  const ShardIndex decoded = ShardIndex::decode(bytes, true, 15);
  EXPECT_EQ(decoded[0], index[0]);
  EXPECT_TRUE(decoded[1].absent());
  EXPECT_EQ(decoded[2], index[2]);
  EXPECT_EQ(decoded.brick_bytes(), 15u);
  EXPECT_THROW(ShardIndex::decode(bytes, true, 14), DamageError);
  EXPECT_THROW(ShardIndex::decode(std::span(bytes).first(51), true, 15), DamageError);
  EXPECT_THROW(ShardIndex::decode(std::span(bytes).first(3), true, 15), DamageError);
  for (const ShardIndex::Entry hostile : {ShardIndex::Entry{ShardIndex::kAbsent, 5},
                                          {5, ShardIndex::kAbsent},
                                          {ShardIndex::kAbsent - 1, 2},
                                          {16, 0},
                                          {1, 15}}) {
    index[1] = hostile;
    EXPECT_THROW(ShardIndex::decode(index.encode(), true, 15), DamageError);
  }
}

}  // namespace
}  // namespace isobrick::test

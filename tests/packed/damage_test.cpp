#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include <isobrick/error.h>
#include "packed/packed_brick.h"
#include "packed/packed_format.h"
#include "tests/packed/fields.h"

namespace isobrick::test {
namespace {

constexpr Int3 kExtent{20, 16, 18};

/// A copy of exactly as many bytes, so that a sanitizer sees what lies beyond; the samples too.
void unpack_copy(ScalarType type, std::span<const std::byte> packed) {
  const std::vector<std::byte> copy(packed.begin(), packed.end());
  std::vector<std::byte> samples(static_cast<std::size_t>(volume(kExtent)) * size_of(type));
  unpack_brick(type, kExtent, copy, samples);
}

/// Whether it is refused; other samples are possible, for the checksum is not the codec's.
bool refused(ScalarType type, std::span<const std::byte> packed) {
  try {
    unpack_copy(type, packed);
    return false;
  } catch (const DamageError& e) {
    EXPECT_FALSE(std::string(e.what()).empty());
    return true;
  }
}

class PackedDamage : public ::testing::TestWithParam<std::tuple<ScalarType, std::string>> {
 protected:
  ScalarType type() const { return std::get<0>(GetParam()); }
  std::vector<std::byte> packed() const {
    return pack_brick(type(), kExtent, make_brick(type(), kExtent, std::get<1>(GetParam())));
  }
};

TEST_P(PackedDamage, EveryBitFlippedInTurn) {
  std::vector<std::byte> bytes = packed();
  // Of long ones all of the beginning, where blocks, palettes and heads lie, and some of the rest.
  const std::size_t step = bytes.size() > 6000 ? 7 : 1;
  for (std::size_t i = 0; i < bytes.size(); i += i < 800 ? 1 : step)
    for (int bit = 0; bit < 8; ++bit) {
      bytes[i] ^= static_cast<std::byte>(1 << bit);
      refused(type(), bytes);
      bytes[i] ^= static_cast<std::byte>(1 << bit);
    }
}

TEST_P(PackedDamage, TruncatedAndExtended) {
  const std::vector<std::byte> bytes = packed();
  for (std::size_t size = 0; size < bytes.size(); size += size < 800 ? 1 : 13)
    EXPECT_TRUE(refused(type(), std::span(bytes).first(size))) << size;
  std::vector<std::byte> longer = bytes;
  longer.push_back({});
  EXPECT_TRUE(refused(type(), longer));
}

TEST_P(PackedDamage, BytesOfChance) {
  std::mt19937 random(7);
  const std::vector<std::byte> whole = packed();
  for (int round = 0; round < 300; ++round) {
    std::vector<std::byte> bytes = whole;
    for (int change = 0; change < 6; ++change)
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    const std::size_t from = random() % bytes.size(), to = random() % bytes.size();
    bytes[to] = bytes[from];
    refused(type(), bytes);
  }
}

INSTANTIATE_TEST_SUITE_P(Types, PackedDamage,
                         ::testing::Combine(::testing::Values(ScalarType::u8, ScalarType::i16,
                                                              ScalarType::f32, ScalarType::f64),
                                            ::testing::Values("smooth", "noisy", "sparse", "labels",
                                                              "extremes")),
                         [](const auto& test) {
                           return std::string(zarr_name(std::get<0>(test.param))) + "_" +
                                  std::get<1>(test.param);
                         });

// Nobody would miss them, but no encoder writes them.
TEST(Packed, ABlockWithBytesTooManyIsRefused) {
  const Int3 extent{16, 16, 16};
  for (const char* field : {"noisy", "sparse"}) {
    auto bytes = pack_brick(ScalarType::u8, extent, make_brick(ScalarType::u8, extent, field));
    bytes.push_back({});
    const auto end = static_cast<std::uint32_t>(bytes.size() - packed::table_bytes(extent));
    std::memcpy(bytes.data() + sizeof(packed::BrickHeader), &end, sizeof end);
    std::vector<std::byte> samples(4096);
    EXPECT_THROW(unpack_brick(ScalarType::u8, extent, bytes, samples), DamageError) << field;
  }
}

// Readers of packed bricks have room for plain samples, not for more.
TEST(Packed, ABrickLongerThanPlainSamplesIsRefused) {
  const Int3 extent{16, 16, 16};
  // All groups with eight dense planes: a block as it should be, but for its length.
  const std::uint32_t all = ~0u, end = 1 + 1 + 4 + 32 * 2 + 4096;
  std::vector<std::byte> bytes(packed::table_bytes(extent) + end);
  const packed::BrickHeader header{.code_bytes = 1};
  std::memcpy(bytes.data(), &header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, &end, sizeof end);
  std::memcpy(bytes.data() + packed::table_bytes(extent) + 2, &all, sizeof all);
  for (std::size_t group = 0; group < 32; ++group)
    bytes[packed::table_bytes(extent) + 6 + 2 * group] = std::byte{0xff};
  std::vector<std::byte> samples(4096);
  EXPECT_THROW(unpack_brick(ScalarType::u8, extent, bytes, samples), DamageError);
}

TEST(Packed, ANumberThatThePaletteLacksIsRefused) {
  const Int3 extent{16, 16, 16};
  auto bytes = pack_brick(ScalarType::u32, extent, make_brick(ScalarType::u32, extent, "labels"));
  std::uint16_t entries = 0;
  std::memcpy(&entries, bytes.data() + 2, sizeof entries);
  ASSERT_EQ(entries, 3);
  // One value less; the blocks begin where the palette ends.
  const std::uint16_t fewer = 2;
  std::memcpy(bytes.data() + 2, &fewer, sizeof fewer);
  bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(packed::table_bytes(extent)),
              bytes.begin() + static_cast<std::ptrdiff_t>(packed::table_bytes(extent)) + 4);
  std::vector<std::byte> samples(4 * 4096);
  EXPECT_THROW(unpack_brick(ScalarType::u32, extent, bytes, samples), DamageError);
}

TEST(Packed, BricksOfAnotherTypeOrShapeAreRefused) {
  const auto bytes =
      pack_brick(ScalarType::u16, kExtent, make_brick(ScalarType::u16, kExtent, "noisy"));
  std::vector<std::byte> samples(static_cast<std::size_t>(volume(kExtent)) * 4);
  EXPECT_THROW(unpack_brick(ScalarType::f32, kExtent, bytes, samples), DamageError);
  EXPECT_THROW(unpack_brick(ScalarType::u8, kExtent, bytes, samples), DamageError);
  EXPECT_THROW(unpack_brick(ScalarType::u16, {20, 16, 34}, bytes, samples), DamageError);
  EXPECT_THROW(unpack_brick(ScalarType::u16, {16, 16, 16}, bytes, samples), DamageError);
}

}  // namespace
}  // namespace isobrick::test

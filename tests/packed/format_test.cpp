#include <gtest/gtest.h>

#include <bit>

#include "packed/bit_planes.h"
#include "packed/packed_brick.h"
#include "tests/packed/fields.h"

namespace isobrick::test {
namespace {

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte b : bytes) {
    constexpr char digits[] = "0123456789abcdef";
    text += digits[std::to_integer<int>(b) >> 4];
    text += digits[std::to_integer<int>(b) & 15];
  }
  return text;
}

template <class T>
std::string packed_hex(Int3 extent, const std::vector<T>& samples) {
  return hex(pack_brick(scalar_type_of<T>, extent, std::as_bytes(std::span(samples))));
}

TEST(PackedFormat, ConstantBrick) {
  // Version 1, one byte a code, no palette; the only block ends after one byte, its base.
  EXPECT_EQ(packed_hex<std::uint8_t>({16, 16, 16}, std::vector<std::uint8_t>(4096, 0x2a)),
            "01010000"
            "01000000"
            "2a");
  // Of floating-point numbers the ordered integer: 1.0f is 0x3f800000, its sign bit flipped.
  EXPECT_EQ(packed_hex<float>({16, 16, 16}, std::vector<float>(4096, 1.0f)),
            "01040000"
            "04000000"
            "000080bf");
}

TEST(PackedFormat, OneSampleThatDiffers) {
  // The sample at (2, 1, 0) is 3 above the base: no differences, group 0, planes 1 and 2 for the
  // code 6, both sparse with column 2 alone, in which bit 1 is set for row 1.
  std::vector<std::uint8_t> samples(4096, 7);
  samples[16 + 2] = 10;
  EXPECT_EQ(packed_hex<std::uint8_t>({16, 16, 16}, samples),
            "01010000"
            "0e000000"
            "07"
            "00"
            "01000000"
            "06"
            "06"
            "0400"
            "0400"
            "02"
            "02");
}

TEST(PackedFormat, RampAlongZ) {
  // v = 5 z. Differences along all axes leave 5 where a slice begins, but for the first: in the
  // groups 2, 4, … 30 the code 10, so planes 1 and 3 with column 0 alone, and row 0 of it.
  std::vector<std::uint8_t> samples(4096);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = static_cast<std::uint8_t>(i / 256 * 5);
  std::string expected =
      "01010000"
      "7e000000"
      "00"
      "07"
      "54555555";
  for (int group = 0; group < 15; ++group) expected += "0a0a";
  for (int plane = 0; plane < 30; ++plane) expected += "0100";
  for (int plane = 0; plane < 30; ++plane) expected += "01";
  EXPECT_EQ(packed_hex<std::uint8_t>({16, 16, 16}, samples), expected);
}

TEST(PackedFormat, DensePlanes) {
  // Ones in odd rows, which differences only spread. All groups have plane 1, with something in
  // every column: two bytes of masks and 16 of the plane each.
  std::vector<std::uint8_t> samples(4096);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = i / 16 % 2 == 1 && i % 3 > 0;
  const std::string packed = packed_hex<std::uint8_t>({16, 16, 16}, samples);
  EXPECT_EQ(packed.substr(0, 28),
            "01010000"
            "46020000"
            "00"
            "00"
            "ffffffff");
  EXPECT_EQ(packed.substr(28, 8), "02000200");
}

TEST(PackedFormat, PlainSamples) {
  EXPECT_EQ(packed_hex<std::uint16_t>({3, 1, 1}, {1, 2, 0x1234}),
            "01000000"
            "010002003412");
}

TEST(PackedFormat, Palette) {
  // Two values far apart: their numbers are packed as samples of one byte. The last sample is the
  // larger one, in group 31 the code 2: plane 1 with column 15 alone, and row 7 of it.
  std::vector<std::int32_t> samples(4096, -100000);
  samples.back() = 100000;
  EXPECT_EQ(packed_hex<std::int32_t>({16, 16, 16}, samples),
            "01010200"
            "0b000000"
            "6079feffa0860100"
            "00"
            "00"
            "00000080"
            "02"
            "02"
            "0080"
            "80");
}

TEST(PackedFormat, CodesKeepSmallAndRoundDifferencesShort) {
  EXPECT_EQ(packed::code_of<std::uint8_t>(0), 0);
  EXPECT_EQ(packed::code_of<std::uint8_t>(1), 2);
  EXPECT_EQ(packed::code_of<std::uint8_t>(0xff), 3);
  EXPECT_EQ(packed::code_of<std::uint8_t>(0x80), 1);
  EXPECT_EQ(packed::code_of<std::uint16_t>(static_cast<std::uint16_t>(-48)), 97);
  for (unsigned d = 0; d < 256; ++d) {
    const auto difference = static_cast<std::uint8_t>(d);
    EXPECT_EQ(packed::difference_of(packed::code_of(difference)), difference);
  }
}

TEST(PackedFormat, OrderOfFloatingPointNumbers) {
  const float values[] = {
      -std::numeric_limits<float>::infinity(), -2, -1e-40f, -0.0f, 0.0f, 1e-40f, 1,
      std::numeric_limits<float>::infinity()};
  std::uint32_t before = 0;
  for (const float value : values) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    const std::uint32_t ordered = packed::ordered_of(bits);
    EXPECT_GT(ordered, before);
    EXPECT_EQ(packed::bits_of_ordered(ordered), bits);
    before = ordered;
  }
}

}  // namespace
}  // namespace isobrick::test

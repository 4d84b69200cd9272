#include "io/volumes/raw/raw_name.h"

#include <gtest/gtest.h>

namespace isobrick::inline v0 {
namespace {

TEST(RawName, FindsExtentAndType) {
  const RawName name = parse_raw_name("engine_256x256x128_uint8");
  EXPECT_EQ(name.extent, (Int3{256, 256, 128}));
  EXPECT_EQ(name.type, ScalarType::u8);
}

TEST(RawName, WordsInAnyOrderAndCase) {
  EXPECT_EQ(parse_raw_name("scan-U16-3X4X5-final").extent, (Int3{3, 4, 5}));
  EXPECT_EQ(parse_raw_name("scan-U16-3X4X5-final").type, ScalarType::u16);
  EXPECT_EQ(parse_raw_name("a.b 10x20x30.float").type, ScalarType::f32);
}

TEST(RawName, TheTypeAfterTheExtentComesFirst) {
  EXPECT_EQ(parse_raw_name("float_study_4x4x4_int16").type, ScalarType::i16);
}

TEST(RawName, TheLastExtentCounts) {
  EXPECT_EQ(parse_raw_name("crop_8x8x8_of_16x16x16_u8").extent, (Int3{16, 16, 16}));
}

TEST(RawName, AllTypes) {
  for (const ScalarType type : kScalarTypes) {
    EXPECT_EQ(parse_raw_name("v_2x2x2_" + std::string(short_name(type))).type, type);
    EXPECT_EQ(parse_raw_name("v_2x2x2_" + std::string(zarr_name(type))).type, type);
  }
}

TEST(RawName, NothingToFind) {
  for (const char* stem : {"", "_", "engine", "256x256", "256x256x", "x256x256", "1x2x3x4",
                           "-1x2x3q", "axbxc", "uint99"}) {
    EXPECT_FALSE(parse_raw_name(stem).extent) << stem;
    EXPECT_FALSE(parse_raw_name(stem).type) << stem;
  }
}

TEST(RawName, HugeNumbersAreNotOverlooked) {
  const RawName name = parse_raw_name("v_99999999999999999999x1x1_u8");
  ASSERT_TRUE(name.extent);
  EXPECT_EQ(name.extent->x, std::numeric_limits<Index>::max());
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include "packed/packed_brick.h"
#include "packed/packed_format.h"
#include "tests/packed/fields.h"
#include "tests/simd_levels.h"

namespace isobrick::test {
namespace {

class PackedRoundTrip : public ::testing::TestWithParam<std::tuple<ScalarType, std::string>> {
 protected:
  ScalarType type() const { return std::get<0>(GetParam()); }
  std::vector<std::byte> brick(Int3 extent) const {
    return make_brick(type(), extent, std::get<1>(GetParam()));
  }
  std::vector<std::byte> unpacked(Int3 extent, std::span<const std::byte> packed) const {
    std::vector<std::byte> samples(static_cast<std::size_t>(volume(extent)) * size_of(type()),
                                   std::byte{0xee});
    unpack_brick(type(), extent, packed, samples);
    return samples;
  }
};

TEST_P(PackedRoundTrip, BricksOfAllShapesComeBack) {
  for (const Int3 extent : {Int3{64, 64, 64}, Int3{16, 16, 16}, Int3{17, 16, 33}, Int3{31, 50, 16},
                            Int3{48, 1, 20}, Int3{1, 1, 1}, Int3{3, 40, 2}}) {
    const auto samples = brick(extent);
    const auto packed = pack_brick(type(), extent, samples);
    ASSERT_EQ(unpacked(extent, packed), samples) << extent.x << ' ' << extent.y << ' ' << extent.z;
    EXPECT_LE(packed.size(), packed::max_packed_bytes(extent, size_of(type())));
  }
}

TEST_P(PackedRoundTrip, EveryProcessorMakesTheSameBytes) {
  const Int3 extent{48, 32, 24};
  const auto samples = brick(extent);
  const auto packed = pack_brick(type(), extent, samples);
  for (const SimdLevel level : testing::simd_levels()) {
    const testing::SimdLevelLimit limit(level);
    EXPECT_EQ(pack_brick(type(), extent, samples), packed) << static_cast<int>(level);
    EXPECT_EQ(unpacked(extent, packed), samples) << static_cast<int>(level);
  }
}

INSTANTIATE_TEST_SUITE_P(Types, PackedRoundTrip,
                         ::testing::Combine(::testing::ValuesIn(kScalarTypes),
                                            ::testing::ValuesIn(kFields)),
                         [](const auto& test) {
                           return std::string(zarr_name(std::get<0>(test.param))) + "_" +
                                  std::get<1>(test.param);
                         });

double ratio(ScalarType type, const std::string& field) {
  const Int3 extent{64, 64, 64};
  const auto samples = make_brick(type, extent, field);
  return static_cast<double>(samples.size()) /
         static_cast<double>(pack_brick(type, extent, samples).size());
}

TEST(Packed, WhatRepeatsTakesFewBytes) {
  for (const ScalarType type : kScalarTypes) {
    EXPECT_GT(ratio(type, "constant"), 400) << zarr_name(type);
    EXPECT_GT(ratio(type, "labels"), 20) << zarr_name(type);
    EXPECT_GT(ratio(type, "sparse"), 4) << zarr_name(type);
    EXPECT_GT(ratio(type, "smooth"), is_floating(type) ? 1.2 : 3.5) << zarr_name(type);
    EXPECT_GT(ratio(type, "noise"), 0.98) << zarr_name(type);
  }
}

// What nothing makes shorter, and bricks that are thinner than blocks, are stored as they are.
TEST(Packed, NoBrickTakesMuchMoreThanItsSamples) {
  for (const ScalarType type : kScalarTypes)
    for (const Int3 extent : {Int3{64, 64, 64}, Int3{5000, 1, 1}, Int3{70, 3, 60}, Int3{1, 1, 1}}) {
      const auto samples = make_brick(type, extent, "noise");
      EXPECT_LE(pack_brick(type, extent, samples).size(), samples.size() + 4) << extent.x;
    }
}

// Numbers of few values are packed, where the values lie far apart.
TEST(Packed, FewValuesTakeAPalette) {
  EXPECT_GT(ratio(ScalarType::u32, "labels"), 3 * ratio(ScalarType::u8, "labels"));
  EXPECT_GT(ratio(ScalarType::f64, "extremes"), 15);
}

}  // namespace
}  // namespace isobrick::test

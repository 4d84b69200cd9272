#include <gtest/gtest.h>

#include <cmath>

#include "isobrick/pipeline/downsample.h"
#include "tests/pipeline/convert_doubles.h"

namespace isobrick {
namespace {

template <class T>
std::vector<T> downsampled(const std::vector<T>& in, Int3 extent) {
  std::vector<T> out(static_cast<std::size_t>(volume(half_extent(extent))));
  downsample(scalar_type_of<T>, extent, reinterpret_cast<const std::byte*>(in.data()),
             reinterpret_cast<std::byte*>(out.data()));
  return out;
}

template <class T>
class Downsample : public testing::Test {};
using IntegerTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                    std::uint32_t, std::int32_t>;
TYPED_TEST_SUITE(Downsample, IntegerTypes);

TYPED_TEST(Downsample, IsTheExactMeanOfWhatExistsRoundedHalfUp) {
  for (const Int3 extent : {Int3{8, 6, 4}, Int3{9, 7, 5}, Int3{1, 1, 1}, Int3{5, 1, 2}}) {
    const auto in = test::make_samples<TypeParam>(extent, 11);
    const auto out = downsampled(in, extent);
    const Int3 half = half_extent(extent);
    for_each_point({{0, 0, 0}, half}, [&](Int3 p) {
      long long sum = 0, count = 0;
      for_each_point(intersect({p * 2, p * 2 + Int3{2, 2, 2}}, {{0, 0, 0}, extent}), [&](Int3 q) {
        sum += static_cast<long long>(in[static_cast<std::size_t>(linear_index(q, extent))]);
        ++count;
      });
      const double mean = static_cast<double>(sum) / static_cast<double>(count);
      EXPECT_EQ(out[static_cast<std::size_t>(linear_index(p, half))],
                static_cast<TypeParam>(std::floor(mean + 0.5)));
    });
  }
}

TEST(DownsampleFloats, LeavesNanOutAndKeepsTheLargest) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const float big = std::numeric_limits<float>::max();
  EXPECT_EQ(downsampled<float>({1, 2, 3, 4, 5, 6, 7, 8}, {2, 2, 2})[0], 4.5f);
  EXPECT_EQ(downsampled<float>({1, nan, 3, nan, nan, nan, nan, 8}, {2, 2, 2})[0], 4.0f);
  EXPECT_TRUE(std::isnan(downsampled<float>(std::vector<float>(8, nan), {2, 2, 2})[0]));
  EXPECT_EQ(downsampled<float>(std::vector<float>(8, big), {2, 2, 2})[0], big);
  EXPECT_EQ(downsampled<float>({inf, 0, 0, nan, 0, 0, 0, 0}, {2, 2, 2})[0], inf);
  EXPECT_EQ(downsampled<float>({3, nan, 5}, {3, 1, 1}), (std::vector<float>{3, 5}));
  const double huge = std::numeric_limits<double>::max();
  EXPECT_EQ(downsampled<double>(std::vector<double>(8, huge), {2, 2, 2})[0], huge);
}

TEST(DownsampleTransform, ShiftsToTheMiddleOnHalvedAxesOnly) {
  Transform t;
  t.spacing = {2, 3, 4};
  t.origin = {10, 20, 30};
  t.direction = {0, 1, 0, 1, 0, 0, 0, 0, 1};
  const Transform half = half_transform(t, {9, 8, 1});
  EXPECT_EQ(half.spacing, (Vec3d{4, 6, 4}));
  EXPECT_EQ(half.origin, (Vec3d{11.5, 21, 30}));
  EXPECT_EQ(half.direction, t.direction);
}

}  // namespace
}  // namespace isobrick

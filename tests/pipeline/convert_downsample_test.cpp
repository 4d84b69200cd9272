#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/convert/downsample.h"
#include "tests/pipeline/convert_doubles.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
std::vector<T> downsampled(const std::vector<T>& in, Int3 extent, Int3 factors = kHalveAll,
                           Downsampling method = Downsampling::mean) {
  std::vector<T> out(static_cast<std::size_t>(volume(coarser_extent(extent, factors))));
  downsample(method, scalar_type_of<T>, extent, factors,
             reinterpret_cast<const std::byte*>(in.data()),
             reinterpret_cast<std::byte*>(out.data()));
  return out;
}

constexpr Int3 kFactors[] = {{2, 2, 2}, {2, 2, 1}, {1, 2, 2}, {1, 1, 2}, {2, 1, 1}, {1, 2, 1}};

template <class T>
class Downsample : public ::testing::Test {};
using IntegerTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                      std::uint32_t, std::int32_t>;
TYPED_TEST_SUITE(Downsample, IntegerTypes);

TYPED_TEST(Downsample, IsTheExactMeanOfWhatExistsRoundedHalfUp) {
  for (const Int3 extent : {Int3{8, 6, 4}, Int3{9, 7, 5}, Int3{1, 1, 1}, Int3{5, 1, 2}})
    for (const Int3 factors : kFactors) {
      const auto in = test::make_samples<TypeParam>(extent, 11);
      const auto out = downsampled(in, extent, factors);
      const Int3 coarser = coarser_extent(extent, factors);
      for_each_point({{0, 0, 0}, coarser}, [&](Int3 p) {
        long long sum = 0, count = 0;
        const Box3 box{p * factors, (p + Int3{1, 1, 1}) * factors};
        for_each_point(intersect(box, {{0, 0, 0}, extent}), [&](Int3 q) {
          sum += static_cast<long long>(in[static_cast<std::size_t>(linear_index(q, extent))]);
          ++count;
        });
        const double mean = static_cast<double>(sum) / static_cast<double>(count);
        EXPECT_EQ(out[static_cast<std::size_t>(linear_index(p, coarser))],
                  static_cast<TypeParam>(std::floor(mean + 0.5)));
      });
    }
}

/// The samples that become one, in ascending order, after the first of them.
template <class T>
std::pair<T, std::vector<T>> box_of(const std::vector<T>& in, Int3 extent, Int3 factors, Int3 p) {
  std::vector<T> values;
  const Box3 box{p * factors, (p + Int3{1, 1, 1}) * factors};
  for_each_point(intersect(box, {{0, 0, 0}, extent}), [&](Int3 q) {
    values.push_back(in[static_cast<std::size_t>(linear_index(q, extent))]);
  });
  const T first = values.front();
  std::sort(values.begin(), values.end());
  return {first, values};
}

TYPED_TEST(Downsample, OtherMethodsTakeOneOfTheSamples) {
  for (const Int3 extent : {Int3{8, 6, 4}, Int3{9, 7, 5}, Int3{5, 1, 2}})
    for (const Int3 factors : kFactors) {
      auto in = test::make_samples<TypeParam>(extent, 11);
      for (TypeParam& v : in) v = static_cast<TypeParam>(v % 3);  // equal values are common
      const auto with = [&](Downsampling method) {
        return downsampled(in, extent, factors, method);
      };
      const auto max = with(Downsampling::max), min = with(Downsampling::min),
                 mode = with(Downsampling::mode), stride = with(Downsampling::stride);
      std::size_t i = 0;
      for_each_point({{0, 0, 0}, coarser_extent(extent, factors)}, [&](Int3 p) {
        const auto [first, values] = box_of(in, extent, factors, p);
        EXPECT_EQ(max[i], values.back());
        EXPECT_EQ(min[i], values.front());
        EXPECT_EQ(stride[i], first);
        const auto count = [&](TypeParam v) { return std::count(values.begin(), values.end(), v); };
        for (const TypeParam v : values)
          EXPECT_TRUE(count(v) < count(mode[i]) || (count(v) == count(mode[i]) && v >= mode[i]));
        ++i;
      });
    }
}

TEST(DownsampleFloats, OtherMethodsLeaveNanOutButStride) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> in{nan, 3, 7, 3, nan, nan, nan, 1};
  const auto one = [&](Downsampling method) {
    return downsampled<float>(in, {2, 2, 2}, kHalveAll, method)[0];
  };
  EXPECT_EQ(one(Downsampling::max), 7);
  EXPECT_EQ(one(Downsampling::min), 1);
  EXPECT_EQ(one(Downsampling::mode), 3);
  EXPECT_TRUE(std::isnan(one(Downsampling::stride)));
  for (const Downsampling method : kDownsamplings)
    EXPECT_TRUE(std::isnan(
        downsampled<float>(std::vector<float>(8, nan), {2, 2, 2}, kHalveAll, method)[0]));
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
  const Transform half = coarser_transform(t, {9, 8, 1}, kHalveAll);
  EXPECT_EQ(half.spacing, (Vec3d{4, 6, 4}));
  EXPECT_EQ(half.origin, (Vec3d{11.5, 21, 30}));
  EXPECT_EQ(half.direction, t.direction);
  const Transform flat = coarser_transform(t, {9, 8, 7}, {2, 1, 1}, Downsampling::max);
  EXPECT_EQ(flat.spacing, (Vec3d{4, 3, 4}));
  EXPECT_EQ(flat.origin, (Vec3d{10, 21, 30}));
  EXPECT_EQ(coarser_transform(t, {9, 8, 7}, kHalveAll, Downsampling::stride).origin, t.origin);
}

TEST(DownsampleFactors, MakeCellsIntoCubes) {
  Transform t;
  t.spacing = {0.4, 0.4, 4};
  Int3 extent{4096, 4096, 100};
  std::vector<Int3> factors;
  for (int i = 0; i < 5; ++i) {
    factors.push_back(factors_by_spacing(t, extent));
    t = coarser_transform(t, extent, factors.back());
    extent = coarser_extent(extent, factors.back());
  }
  const Int3 flat{2, 2, 1};
  EXPECT_EQ(factors, (std::vector<Int3>{flat, flat, flat, kHalveAll, kHalveAll}));
  t.spacing = {0.5, 0.5, 0.7};
  EXPECT_EQ(factors_by_spacing(t, extent), kHalveAll);
  // One plane has no spacing to speak of.
  EXPECT_EQ(factors_by_spacing(Transform{.spacing = {3, 3, 1}}, {64, 64, 1}), kHalveAll);
}

}  // namespace
}  // namespace isobrick

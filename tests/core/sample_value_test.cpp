#include <isobrick/sample_value.h>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "core/surface_range.h"
#include "core/wide_type.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kLargest = std::numeric_limits<std::uint64_t>::max();
constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();

TEST(SampleValue, IsExact) {
  EXPECT_EQ(SampleValue(kLargest).text(), "18446744073709551615");
  EXPECT_EQ(SampleValue(kLargest).as<std::uint64_t>(), kLargest);
  EXPECT_EQ(SampleValue(kLeast).text(), "-9223372036854775808");
  EXPECT_EQ(SampleValue(kLeast).as<std::int64_t>(), kLeast);
  EXPECT_EQ(SampleValue(0.5).text(), "0.5");
  EXPECT_EQ(double{SampleValue(kLargest)}, 0x1p64);
  EXPECT_FALSE(SampleValue(kLargest) == SampleValue(kLargest - 1));
  EXPECT_FALSE(SampleValue(kLargest) == 0x1p64);
  EXPECT_TRUE(SampleValue(3) == 3.0);
  EXPECT_TRUE(SampleValue(-3) == SampleValue(-3.0));
  EXPECT_FALSE(SampleValue(std::nan("")) == SampleValue(std::nan("")));
}

TEST(SampleValue, IsOfATypeOrNot) {
  for (const auto& [value, u64, i64, u8, i8] :
       {std::tuple(SampleValue(kLargest), true, false, false, false),
        {SampleValue(0x1p64), false, false, false, false},
        {SampleValue(kLeast), false, true, false, false},
        {SampleValue(-0x1p63), false, true, false, false},
        {SampleValue(0x1p63), true, false, false, false},
        {SampleValue(-1), false, true, false, true},
        {SampleValue(200), true, true, true, false},
        {SampleValue(0.5), false, false, false, false},
        {SampleValue(std::nan("")), false, false, false, false}}) {
    SCOPED_TRACE(value.text());
    EXPECT_EQ(is_sample(value, ScalarType::u64), u64);
    EXPECT_EQ(is_sample(value, ScalarType::i64), i64);
    EXPECT_EQ(is_sample(value, ScalarType::u8), u8);
    EXPECT_EQ(is_sample(value, ScalarType::i8), i8);
    EXPECT_TRUE(is_sample(value, ScalarType::f32));
  }
}

/// Whether a double is below an integer, compared without rounding either.
template <class T>
bool is_below(double d, T v) {
  return static_cast<long double>(d) < static_cast<long double>(v);
}

template <class T>
class SurfaceRange : public ::testing::Test {};
using WideIntegers = ::testing::Types<std::uint64_t, std::int64_t>;
TYPED_TEST_SUITE(SurfaceRange, WideIntegers);

TYPED_TEST(SurfaceRange, HoldsItsSamplesAndKeepsWhatDiffersApart) {
  static_assert(std::numeric_limits<long double>::digits >= 64);
  using T = TypeParam;
  using Limits = std::numeric_limits<T>;
  std::mt19937_64 random(1);
  std::vector<T> ends{Limits::lowest(),  Limits::lowest() + 1, 0,          1,
                      Limits::max() - 1, Limits::max(),        T{1} << 53, (T{1} << 53) + 1,
                      (T{1} << 60) + 3};
  for (int i = 0; i < 200; ++i) ends.push_back(static_cast<T>(random() >> i % 60));
  for (const T lo : ends)
    for (const T hi : {lo, lo == Limits::max() ? lo : static_cast<T>(lo + 1), ends[9], ends[20]}) {
      if (hi < lo) continue;
      const ValueRange<double> range = surface_range(ValueRange<T>{lo, hi});
      if (lo == hi) {
        EXPECT_EQ(range, (ValueRange<double>{static_cast<double>(lo), static_cast<double>(lo)}));
        continue;
      }
      EXPECT_LT(range.lo, range.hi);
      EXPECT_FALSE(is_below(-range.lo, -static_cast<long double>(lo))) << lo;
      EXPECT_FALSE(is_below(range.hi, hi)) << hi;
      // No wider than need be.
      EXPECT_TRUE(range.lo == static_cast<double>(lo) ||
                  !is_below(std::nextafter(range.lo, HUGE_VAL), lo))
          << lo;
      // What is rounded to the nearest lies within.
      using Bits = std::uint64_t;
      const Bits half = (static_cast<Bits>(hi) - static_cast<Bits>(lo)) / 2;
      for (const T v : {lo, hi, static_cast<T>(static_cast<Bits>(lo) + half)}) {
        EXPECT_LE(range.lo, static_cast<double>(v));
        EXPECT_GE(range.hi, static_cast<double>(v));
      }
    }
}

TEST(SurfaceRange, IsTheRangeItselfOfOtherTypes) {
  EXPECT_TRUE(surface_range(ValueRange<std::uint64_t>{}).empty());
  EXPECT_EQ(surface_range(ValueRange<float>{-1.5F, 2}), (ValueRange<double>{-1.5, 2}));
  EXPECT_EQ(surface_range(ValueRange<std::int32_t>{-7, 9}), (ValueRange<double>{-7, 9}));
}

TEST(SurfaceSamples, AreIntegersThatADoubleHolds) {
  std::array<std::int64_t, 3> samples{-5, kLeast, std::int64_t{1} << 53};
  auto* bytes = reinterpret_cast<std::byte*>(samples.data());
  make_surface_samples(ScalarType::u16, bytes, 3);
  EXPECT_EQ(samples[0], -5) << "another type stays";
  make_surface_samples(ScalarType::i64, bytes, 3);
  std::array<double, 3> doubles;
  std::memcpy(doubles.data(), bytes, sizeof doubles);
  EXPECT_EQ(doubles, (std::array<double, 3>{-5, -0x1p63, 0x1p53}));
}

}  // namespace
}  // namespace isobrick

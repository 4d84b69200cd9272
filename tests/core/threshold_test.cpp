#include "core/threshold.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace isobrick::inline v0 {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

template <class T>
class ThresholdOf : public ::testing::Test {
 protected:
  using Limits = std::numeric_limits<T>;

  /// Values at the corners of T.
  static std::vector<T> samples() {
    std::vector<T> values{Limits::lowest(), Limits::max(), T(0), T(1), T(2), T(100)};
    if constexpr (Limits::is_signed) values.insert(values.end(), {T(-1), T(-2), T(-100)});
    if constexpr (Limits::is_integer)
      values.insert(values.end(), {T(Limits::max() - 1), T(Limits::lowest() + 1)});
    if constexpr (Limits::has_infinity)
      values.insert(values.end(),
                    {Limits::infinity(), -Limits::infinity(), Limits::min(), -Limits::min(),
                     Limits::denorm_min(), -Limits::denorm_min(), -T(0), T(0.1), T(-0.1),
                     std::nextafter(Limits::max(), T(0)), std::nextafter(T(1), T(2))});
    return values;
  }

  /// Isovalues at those values, just beside and between them, and beyond them.
  static std::vector<double> isovalues() {
    std::vector<double> all{-kInf,   kInf,  1e300, -1e300,       1e-300,
                            -1e-300, 255.5, 256,   4294967295.5, 4294967296.0};
    for (const T sample : samples()) {
      const auto v = static_cast<double>(sample);
      for (const double iso :
           {v, std::nextafter(v, kInf), std::nextafter(v, -kInf), v + 0.5, v - 0.5})
        if (!std::isnan(iso)) all.push_back(iso);
    }
    return all;
  }

  /// The value of T before `v`, which is not the first.
  static T before(T v) {
    if constexpr (Limits::is_integer)
      return static_cast<T>(v - 1);
    else
      return std::nextafter(v, -Limits::infinity());
  }
};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(ThresholdOf, SampleTypes);

TYPED_TEST(ThresholdOf, ComparesSamplesAsTheIsovalueDoes) {
  for (const double iso : this->isovalues()) {
    const Threshold<TypeParam> threshold(iso);
    for (const TypeParam sample : this->samples())
      ASSERT_EQ(!threshold.none && sample >= threshold.value, static_cast<double>(sample) >= iso)
          << +sample << " at " << iso;
  }
}

TYPED_TEST(ThresholdOf, IsTheSmallestValueThatIsNotBelow) {
  using Type = std::numeric_limits<TypeParam>;
  const TypeParam first = Type::has_infinity ? -Type::infinity() : Type::lowest();
  for (const double iso : this->isovalues()) {
    const Threshold<TypeParam> threshold(iso);
    if (threshold.none) continue;
    ASSERT_GE(static_cast<double>(threshold.value), iso);
    if (threshold.value == first) continue;
    ASSERT_LT(static_cast<double>(this->before(threshold.value)), iso);
  }
}

TYPED_TEST(ThresholdOf, ThereIsNoneAboveTheTypeAndForNaN) {
  using Type = std::numeric_limits<TypeParam>;
  const auto most = static_cast<double>(Type::max());
  EXPECT_TRUE(Threshold<TypeParam>(std::nan("")).none);
  EXPECT_FALSE(Threshold<TypeParam>(most).none);
  EXPECT_FALSE(Threshold<TypeParam>(-kInf).none);
  // Infinity is a sample of floating types, and reaches every isovalue.
  EXPECT_EQ(Threshold<TypeParam>(std::nextafter(most, kInf)).none, Type::is_integer);
  EXPECT_EQ(Threshold<TypeParam>(kInf).none, Type::is_integer);
  EXPECT_EQ(Threshold<TypeParam>(kInf).value, Type::is_integer ? Type::max() : Type::infinity());
}

}  // namespace
}  // namespace isobrick

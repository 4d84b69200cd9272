#include "isobrick/index/stab_value.h"

#include <gtest/gtest.h>

#include "isobrick/core/range.h"
#include "range_sets.h"

namespace isobrick {
namespace {

template <class T>
class StabValueOf : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(StabValueOf, SampleTypes);

/// Comparing in T is comparing with the isovalue, for ranges and isovalues at all corners of T.
TYPED_TEST(StabValueOf, ComparesInTheTypeAsTheIsovalueDoes) {
  using T = TypeParam;
  using Limits = std::numeric_limits<T>;
  std::vector<T> values{Limits::lowest(), Limits::max(), T(0), T(1), T(2), T(100)};
  if constexpr (Limits::is_signed) values.insert(values.end(), {T(-1), T(-2), T(-100)});
  if constexpr (Limits::has_infinity)
    values.insert(values.end(), {Limits::infinity(), -Limits::infinity(), Limits::denorm_min(),
                                 -Limits::denorm_min(), T(0.1), T(-0.1)});
  std::vector<ValueRange<T>> ranges;
  for (const T lo : values)
    for (const T hi : values) ranges.push_back({lo, hi});
  for (const double iso : isovalues_for(ranges, ranges.size())) {
    const StabValue<T> stab(iso);
    for (const ValueRange<T>& range : ranges)
      ASSERT_EQ(!stab.none && range.lo < stab.value && stab.value <= range.hi,
                range.stabbed_by(iso))
          << +range.lo << " … " << +range.hi << " at " << iso;
  }
}

}  // namespace
}  // namespace isobrick

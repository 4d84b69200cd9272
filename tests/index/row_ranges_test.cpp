#include "index/row_ranges.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>

#include "tests/simd_levels.h"

namespace isobrick::testing {
namespace {

/// Rows of random samples with gaps; NaN among them where `with_nan`.
template <class T>
struct Rows {
  Rows(Index width, Index rows, Index planes, bool with_nan) {
    bundle = {nullptr, width, rows, planes, width + 3, (width + 3) * rows + 5};
    samples.resize(static_cast<std::size_t>(bundle.plane_stride * planes));
    std::mt19937 random(static_cast<unsigned>(width));
    for (T& sample : samples) {
      sample = static_cast<T>(static_cast<std::int32_t>(random()));
      if constexpr (std::numeric_limits<T>::has_quiet_NaN)
        if (with_nan && random() % 20 == 0) sample = std::numeric_limits<T>::quiet_NaN();
    }
    bundle.first = samples.data();
  }
  Rows(const Rows&) = delete;

  std::vector<T> samples;
  RowBundle bundle;
};

/// By definition.
template <class T>
ValueRange<T> range_of(const RowBundle& bundle, Index column) {
  ValueRange<T> range;
  for (Index z = 0; z < bundle.planes; ++z)
    for (Index y = 0; y < bundle.rows; ++y)
      range.include(static_cast<const T*>(
          bundle.first)[z * bundle.plane_stride + y * bundle.row_stride + column]);
  return range;
}

template <class T>
class RowRanges : public ::testing::Test {};
using LevelTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                    std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(RowRanges, LevelTypes);

TYPED_TEST(RowRanges, AreThoseOfTheColumnsOnEveryProcessor) {
  for (const SimdLevel level : simd_levels()) {
    const SimdLevelLimit limit(level);
    ASSERT_EQ(simd_level(), level);
    for (const Index width : {1, 7, 16, 33, 130})
      for (const Index rows : {1, 4, 17})
        for (const bool with_nan : {false, true}) {
          const Rows<TypeParam> made(width, rows, 3, with_nan);
          ColumnRanges<TypeParam> columns;
          columns.reset(width);
          const bool has_nan = columns.add(made.bundle);
          bool expected_nan = false;
          for (Index z = 0; z < 3; ++z)
            for (Index y = 0; y < rows; ++y)
              for (Index x = 0; x < width; ++x) {
                const TypeParam v = made.samples[static_cast<std::size_t>(
                    z * made.bundle.plane_stride + y * made.bundle.row_stride + x)];
                expected_nan = expected_nan || v != v;
              }
          EXPECT_EQ(has_nan, expected_nan) << static_cast<int>(level);
          for (Index x = 0; x < width; ++x)
            ASSERT_EQ(columns.over(x, x + 1), range_of<TypeParam>(made.bundle, x))
                << static_cast<int>(level) << " column " << x << " of " << width;
        }
  }
}

}  // namespace
}  // namespace isobrick::testing

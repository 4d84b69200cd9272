#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/simd_levels.h"
#include "tests/surface/field.h"

namespace isobrick::testing {
namespace {

template <class T>
class SimdLevels : public ::testing::Test {};
using LevelTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                    std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(SimdLevels, LevelTypes);

// Users have other processors than the one that runs the tests.
TYPED_TEST(SimdLevels, NeverShowInAMesh) {
  auto field = padded_noise<TypeParam>({70, 45, 51}, 0, 100, TypeParam{0}, 7);
  if constexpr (std::is_floating_point_v<TypeParam>)
    for (std::size_t i = 0; i < field.samples.size(); i += 997)
      field.samples[i] = std::numeric_limits<TypeParam>::quiet_NaN();
  for (const bool drop : {false, true})
    for (const double isovalue : {42.0, 42.3}) {
      const Request request{.isovalue = isovalue, .normals = true, .drop_degenerate = drop};
      const Mesh best = extract(field, request);
      ASSERT_GT(best.triangles.size(), 10000u);
      for (const SimdLevel level : simd_levels()) {
        const SimdLevelLimit limit(level);
        ASSERT_EQ(simd_level(), level);
        // Of the bytes: −0 is not 0.
        const Mesh mesh = extract(field, request);
        ASSERT_EQ(mesh.positions.size(), best.positions.size());
        ASSERT_EQ(mesh.normals.size(), best.normals.size());
        EXPECT_EQ(mesh.triangles, best.triangles) << static_cast<int>(level);
        const std::size_t bytes = best.positions.size() * sizeof(Vec3f);
        EXPECT_EQ(std::memcmp(mesh.positions.data(), best.positions.data(), bytes), 0)
            << static_cast<int>(level);
        EXPECT_EQ(std::memcmp(mesh.normals.data(), best.normals.data(), bytes), 0)
            << static_cast<int>(level);
      }
    }
}

}  // namespace
}  // namespace isobrick::testing

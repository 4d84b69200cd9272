#include <gtest/gtest.h>

#include <map>

#include <isobrick/mesh_filters.h>
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

/// Vertices whose triangles are not one fan, closed or open.
std::size_t pinched_vertices(const Mesh& mesh) {
  struct Fan {
    std::map<std::uint32_t, std::uint32_t> following;
    std::map<std::uint32_t, std::uint32_t> before;
    std::size_t triangles = 0;
  };
  std::vector<Fan> fans(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      Fan& fan = fans[t[i]];
      fan.following[t[(i + 1) % 3]] = t[(i + 2) % 3];
      fan.before[t[(i + 2) % 3]] = t[(i + 1) % 3];
      ++fan.triangles;
    }
  std::size_t pinched = 0;
  for (const Fan& fan : fans) {
    if (fan.triangles == 0) continue;
    std::uint32_t start = fan.following.begin()->first;
    for (std::size_t i = 0; i < fan.triangles && fan.before.contains(start); ++i)
      start = fan.before.at(start);
    std::size_t steps = 0;
    for (std::uint32_t at = start; fan.following.contains(at) && steps <= fan.triangles; ++steps) {
      at = fan.following.at(at);
      if (at == start) {
        ++steps;
        break;
      }
    }
    pinched += steps != fan.triangles;
  }
  return pinched;
}

double random_sample(double x, double y, double z) {
  const double s = std::sin(x * 127.1 + y * 311.7 + z * 74.7) * 43758.5453;
  return s - std::floor(s);
}

/// Noisy gyroids of whole numbers around 0: many samples equal the isovalue.
Mesh steps(Index n) {
  return surface_of(n, 0, 10, [](double x, double y, double z) {
    return std::round(4 * (std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) +
                           std::sin(z) * std::cos(x) + 0.3 * random_sample(x, y, z)));
  });
}

Mesh noise(Index n) {
  return surface_of(n, 0, 10,
                    [](double x, double y, double z) { return random_sample(x, y, z) - 0.4; });
}

Mesh thin_shell(Index n) {
  return surface_of(n, -1.3, 1.3, [](double x, double y, double z) {
    return 0.01 - std::abs(1 - std::hypot(x, y, z));
  });
}

void expect_same_topology(const Mesh& mesh, const std::vector<double>& ratios) {
  const MeshMeasure before = measure(mesh);
  ASSERT_EQ(pinched_vertices(mesh), 0U);
  for (const double ratio : ratios) {
    const Filtered simple = filtered(mesh, {.simplify_ratio = ratio, .measure = true});
    EXPECT_EQ(simple.measure->euler_number, before.euler_number) << ratio;
    EXPECT_EQ(simple.measure->components, before.components) << ratio;
    EXPECT_EQ(simple.measure->open_sides, before.open_sides) << ratio;
    EXPECT_EQ(pinched_vertices(simple.mesh), 0U) << ratio;
    const double expected = ratio * static_cast<double>(mesh.triangles.size());
    // Components and handles need triangles, and what is on the border stays.
    const double least = static_cast<double>(before.components + before.open_sides) +
                         std::abs(static_cast<double>(before.euler_number));
    if (expected > 8 * least) {
      EXPECT_NEAR(static_cast<double>(simple.size.triangles), expected, 2) << ratio;
    }
  }
}

TEST(SimplifyTopology, SamplesThatEqualTheIsovalue) {
  const Mesh mesh = steps(90);
  ASSERT_GT(mesh.triangles.size(), 150000U);  // several groups
  expect_same_topology(mesh, {0.5, 0.1});
}

TEST(SimplifyTopology, Noise) { expect_same_topology(noise(40), {0.5, 0.02}); }

TEST(SimplifyTopology, ThinShells) { expect_same_topology(thin_shell(100), {0.3, 0.05}); }

TEST(SimplifyTopology, WithinAnError) {
  const Mesh mesh = steps(60);
  const MeshMeasure before = measure(mesh),
                    after = *filtered(mesh, {.max_error = 0.1, .measure = true}).measure;
  EXPECT_LT(after.triangles, before.triangles / 2);
  EXPECT_EQ(after.euler_number, before.euler_number);
  EXPECT_EQ(after.components, before.components);
  EXPECT_EQ(after.open_sides, before.open_sides);
}

TEST(SimplifyTopology, TheGoalIsReported) {
  Mesh mesh = steps(30), result;
  MemorySink sink(result);
  MeshFilter filter(sink, {.simplify_ratio = 0.25});
  write_chunks(mesh, filter, 1000);
  EXPECT_EQ(
      filter.simplify_goal(),
      static_cast<std::uint64_t>(std::llround(0.25 * static_cast<double>(mesh.triangles.size()))));
  MeshFilter within(sink, {.max_error = 0.1});
  write_chunks(mesh, within, 1000);
  EXPECT_EQ(within.simplify_goal(), std::nullopt);
}

}  // namespace
}  // namespace isobrick::test

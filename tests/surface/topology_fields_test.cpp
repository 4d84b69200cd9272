#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <random>
#include <string>

#include "tests/surface/mesh_topology.h"

// Topology::trilinear in whole fields: the surface is that of the interpolant.

namespace isobrick::testing {
namespace {

/// A kind of random fields, and the isovalue.
struct Kind {
  const char* name;
  double isovalue;
  double raise;  ///< what decides ties: half of what could be between two samples' sides
  std::function<double(std::mt19937&)> sample;
};

double uniform(std::mt19937& random) {
  return (static_cast<double>(random()) + 0.5) / 4294967296.0;
}
double whole(std::mt19937& random, int lo, int hi) {
  return lo + static_cast<double>(random() % static_cast<unsigned>(hi - lo + 1));
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"uniform noise", 0.5, 0, [](auto& random) { return uniform(random); }},
      {"mostly outside", 0.7, 0, [](auto& random) { return uniform(random); }},
      {"ties of faces", 0, 1e-6, [](auto& random) { return whole(random, 0, 1) * 2 - 1; }},
      {"ties with samples", 0, 1e-6, [](auto& random) { return whole(random, -2, 1); }},
      {"ties of saddles", 0, 1e-6,
       [](auto& random) {
         const double size = whole(random, 1, 3);
         return random() % 2 ? size : -size;
       }},
      {"near saddles", 0, 0,
       [](auto& random) {
         const double size = 1 + 0.05 * uniform(random);
         return random() % 2 ? size : -size;
       }},
      {"bytes", 127.5, 1e-6, [](auto& random) { return whole(random, 0, 255); }},
      {"two scales", 0, 0,
       [](auto& random) {
         const double size = random() % 2 ? uniform(random) : 0.05 * uniform(random);
         return random() % 2 ? size : -size;
       }},
  };
  return all;
}

/// A field with a shell of outside samples.
Field<float> field_of(const Kind& kind, int edge, unsigned seed) {
  std::mt19937 random(seed);
  Field<float> field({edge, edge, edge}, [&](Int3 p) -> double {
    for (int axis = 0; axis < 3; ++axis)
      if (p[axis] == 0 || p[axis] == edge - 1) return kind.isovalue - 1;
    return kind.sample(random);
  });
  return field;
}

Mesh trilinear(const Field<float>& field, double isovalue) {
  return extract(field, {.isovalue = isovalue, .topology = Topology::trilinear});
}

TEST(TopologyFields, BettiNumbersAreThoseOfTheInterpolant) {
  const unsigned fields = std::getenv("ISOBRICK_TEST_ALL") ? 40'000 : 10'000;
  for (unsigned seed = 0; seed < fields; ++seed) {
    const Kind& kind = kinds()[seed % kinds().size()];
    const int edge = seed % 10 < 6 ? 4 : seed % 10 < 9 ? 5 : 6;
    const Field<float> field = field_of(kind, edge, seed);
    const Mesh mesh = trilinear(field, kind.isovalue);
    const std::string what = std::string(kind.name) + ", seed " + std::to_string(seed);
    ASSERT_TRUE(is_closed_manifold(mesh)) << what;
    ASSERT_EQ(betti_of(mesh), betti_of_interpolant(field, kind.isovalue, kind.raise)) << what;
  }
}

// The reference above refines cell by cell; here the whole field is refined at once.
TEST(TopologyFields, BettiNumbersAreThoseOfRefinedFields) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    const Kind& kind = kinds()[seed % 2];
    const Field<float> field = field_of(kind, 5, 1000 + seed);
    const auto refined = [&](int n) {
      return betti_of(extract(refined_field(field, n), {.isovalue = kind.isovalue}));
    };
    Betti last = refined(12);
    for (int n = 24; n <= 96; n *= 2) {
      const Betti next = refined(n);
      if (next == last) break;
      last = next;
    }
    EXPECT_EQ(betti_of(trilinear(field, kind.isovalue)), last) << "seed " << seed;
  }
}

}  // namespace
}  // namespace isobrick::testing

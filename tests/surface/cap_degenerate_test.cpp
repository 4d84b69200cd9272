#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tests/surface/kept_triangles.h"
#include "tests/surface/mesh_topology.h"

// SurfaceOptions::cap together with SurfaceOptions::drop_degenerate.

namespace isobrick::testing {
namespace {

template <class T>
class CapWithoutDegenerate : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(CapWithoutDegenerate, Types);

constexpr Topology kTopologies[] = {Topology::consistent, Topology::trilinear};
constexpr Inside kInsides[] = {Inside::above, Inside::below};

/// Noise of few values; `missing`: every so manieth sample is NaN.
template <class T>
Field<T> coarse(Int3 extent, unsigned seed, unsigned missing = 0) {
  std::mt19937 random(seed);
  return Field<T>(extent, [&](Int3) -> double {
    const auto value = static_cast<double>(random() % 5);
    return missing > 0 && random() % missing == 0 ? std::nan("") : value;
  });
}

using Corner = std::array<float, 3>;
Corner corner(const Mesh& mesh, std::uint32_t vertex) {
  const Vec3f p = mesh.positions[vertex];
  return {p.x, p.y, p.z};
}

/// By definition: what remains of a mesh without the triangles that have two corners in one place,
/// which coincident vertices and those of the cap on their samples have.
std::multiset<std::array<float, 9>> without_degenerate(const Mesh& mesh, std::uint64_t& left_out) {
  auto triangles = soup(mesh);
  left_out = std::erase_if(triangles, [](const std::array<float, 9>& t) {
    const auto equal = [&](int a, int b) {
      return t[3 * a] == t[3 * b] && t[3 * a + 1] == t[3 * b + 1] && t[3 * a + 2] == t[3 * b + 2];
    };
    return equal(0, 1) || equal(1, 2) || equal(2, 0);
  });
  return triangles;
}

/// The mesh of a request, which is what remains of the capped one.
template <class T>
Mesh expect_merged(const Field<T>& field, Request request) {
  request.cap = true;
  request.drop_degenerate = false;
  std::uint64_t left_out = 0;
  const auto expected = without_degenerate(extract(field, request), left_out);
  request.drop_degenerate = true;
  Mesh mesh = extract(field, request);
  EXPECT_EQ(soup(mesh), expected);
  EXPECT_EQ(mesh.degenerate, left_out);
  EXPECT_EQ(unused_vertices(mesh), 0u);
  EXPECT_TRUE(sides_balance(mesh));
  return mesh;
}

TYPED_TEST(CapWithoutDegenerate, IsTheCappedMeshMerged) {
  for (const Int3 extent : {Int3{66, 35, 5}, Int3{2, 3, 70}})
    for (const Topology topology : kTopologies)
      for (const Inside inside : kInsides)
        for (const double isovalue : {1.0, 4.0}) {
          const auto field = coarse<TypeParam>(extent, 5);
          const Mesh mesh =
              expect_merged(field, {.isovalue = isovalue, .inside = inside, .topology = topology});
          if (topology == Topology::trilinear) continue;  // whose inner vertices may meet
          std::set<Corner> places;
          for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) places.insert(corner(mesh, v));
          EXPECT_EQ(places.size(), mesh.positions.size());
        }
}

TYPED_TEST(CapWithoutDegenerate, OfRegions) {
  const auto field = coarse<TypeParam>({70, 50, 40}, 6);
  for (const Box3 roi : {Box3{{3, 5, 1}, {69, 40, 39}}, Box3{{32, 16, 0}, {65, 33, 40}},
                         Box3{{31, 31, 31}, {34, 34, 34}}, Box3{{33, 0, 0}, {34, 50, 40}}})
    expect_merged(field, {.isovalue = 2, .roi = roi});
}

TYPED_TEST(CapWithoutDegenerate, TilesBricksAndThreadsDoNotShow) {
  const auto field = coarse<TypeParam>({70, 66, 40}, 9);
  Request request{.isovalue = 2, .normals = true, .drop_degenerate = true, .cap = true};
  const Mesh mesh = extract(field, request);
  request.batch = 1;
  request.workspaces = 1;
  EXPECT_EQ(extract(field, request), mesh);
  request.brick = {16, 32, 64};
  EXPECT_EQ(extract(field, request), mesh);
  request.indexing = Indexing::chunk_local;
  EXPECT_EQ(soup(extract(field, request)), soup(mesh));
}

// A vertex that the surface has too keeps the gradient, others have the normal of the border.
TYPED_TEST(CapWithoutDegenerate, NormalsAreThoseOfSurfaceAndBorder) {
  const auto field = coarse<TypeParam>({40, 36, 35}, 10);
  for (const Inside inside : kInsides) {
    Request request{.isovalue = 2, .inside = inside, .normals = true, .drop_degenerate = true};
    const auto normals_of = [&](const Mesh& mesh) {
      std::map<Corner, Corner> normals;
      for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3f n = mesh.normals[v];
        normals[corner(mesh, v)] = {n.x, n.y, n.z};
      }
      return normals;
    };
    const auto surface = normals_of(extract(field, request));
    request.cap = true;
    const auto both = normals_of(extract(field, request));
    std::size_t of_surface = 0, of_border = 0;
    for (const auto& [place, normal] : both) {
      if (const auto found = surface.find(place); found != surface.end()) {
        ASSERT_EQ(normal, found->second);
        ++of_surface;
        continue;
      }
      Vec3<double> outwards{0, 0, 0};
      for (int axis = 0; axis < 3; ++axis) {
        const float at = place[static_cast<std::size_t>(axis)];
        outwards[axis] = at == 0 ? -1 : at == static_cast<float>(field.extent[axis] - 1) ? 1 : 0;
      }
      const double length = std::hypot(outwards.x, outwards.y, outwards.z);
      for (int axis = 0; axis < 3; ++axis)
        ASSERT_FLOAT_EQ(normal[static_cast<std::size_t>(axis)],
                        static_cast<float>(outwards[axis] / length));
      ++of_border;
    }
    EXPECT_GT(of_surface, 1000u);
    EXPECT_GT(of_border, 100u);
  }
}

TEST(CapWithoutDegenerateAt, AroundNan) {
  for (const unsigned missing : {7u, 100u})
    for (const Topology topology : kTopologies)
      for (const Inside inside : kInsides) {
        const Request request{.isovalue = 2, .inside = inside, .topology = topology};
        expect_merged(coarse<float>({40, 36, 35}, 8, missing), request);
        expect_merged(coarse<double>({40, 36, 35}, 8, missing), request);
      }
}

TEST(CapWithoutDegenerateAt, WhereAllSamplesEqualTheIsovalue) {
  const Field<float> field({5, 40, 5});
  const Mesh box =
      extract(field, {.isovalue = 0, .normals = true, .drop_degenerate = true, .cap = true});
  EXPECT_EQ(box, extract(field, {.isovalue = 0, .normals = true, .cap = true}));
  EXPECT_TRUE(is_closed_manifold(box));
}

}  // namespace
}  // namespace isobrick::testing

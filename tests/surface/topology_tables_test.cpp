#include "surface/topology_tables.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>

#include "surface/case_tables.h"

namespace isobrick::inline v0 {
namespace {

using Side = std::pair<int, int>;

/// Directed sides of a patch; checks that none is there twice.
std::set<Side> sides_of(const CellPatch& patch) {
  const std::uint8_t* corners = topology_tables().corners + patch.first;
  std::set<Side> sides;
  for (int t = 0; t < patch.triangles; ++t)
    for (int i = 0; i < 3; ++i) {
      const Side side{corners[3 * t + i], corners[3 * t + (i + 1) % 3]};
      EXPECT_NE(side.first, side.second);
      EXPECT_TRUE(sides.insert(side).second);
    }
  return sides;
}

/// The sides without an opposite one.
std::set<Side> border_of(const std::set<Side>& sides) {
  std::set<Side> border;
  for (const Side& side : sides)
    if (!sides.count({side.second, side.first})) border.insert(side);
  return border;
}

/// Calls f(case, joined faces, patch) for every patch that a cell can have.
template <class F>
void for_each_patch(F&& f) {
  const TopologyTables& tables = topology_tables();
  for (int index = 0; index < 256; ++index) {
    const CaseConfigurations& of_case = tables.cases[index];
    const int ambiguous = case_rule::ambiguous_faces(index);
    for (int choice = 0; choice < 1 << of_case.faces; ++choice) {
      int joined = 0;
      for (int face = 0, n = 0; face < 6; ++face)
        if (ambiguous >> face & 1) joined |= (choice >> n++ & 1) << face;
      const FaceConfiguration& decided = tables.configurations[of_case.first + choice];
      f(index, joined, tables.patches[decided.patch]);
      for (const std::uint16_t tunnel : decided.tunnel)
        for (int diagonal = 0; tunnel && diagonal < 4; ++diagonal)
          f(index, joined, tables.patches[tunnel + diagonal]);
    }
  }
}

TEST(TopologyTables, BordersAreTheSegmentsOfTheFaces) {
  for_each_patch([](int index, int joined, const CellPatch& patch) {
    std::set<Side> expected;
    const auto next = case_rule::successors(index, joined);
    for (int e = 0; e < 12; ++e)
      if (next[static_cast<std::size_t>(e)] >= 0)
        expected.insert({e, next[static_cast<std::size_t>(e)]});
    ASSERT_EQ(border_of(sides_of(patch)), expected) << index << " " << joined;
  });
}

TEST(TopologyTables, NoSideWithinLiesInAFace) {
  const auto faces = case_rule::faces_of_edges();
  for_each_patch([&](int index, int, const CellPatch& patch) {
    const std::set<Side> sides = sides_of(patch);
    for (const auto& [a, b] : sides)
      if (a < 12 && b < 12 && sides.count({b, a})) {
        ASSERT_EQ(faces[static_cast<std::size_t>(a)] & faces[static_cast<std::size_t>(b)], 0)
            << index;
      }
  });
}

TEST(TopologyTables, PatchesAreDiscsAndATunnelIsARingLess) {
  for_each_patch([](int index, int joined, const CellPatch& patch) {
    const std::set<Side> sides = sides_of(patch);
    std::set<int> vertices;
    for (const auto& [a, b] : sides) vertices.insert({a, b});
    int loops = 0;
    auto next = case_rule::successors(index, joined);
    for (int e = 0; e < 12; ++e) loops += case_rule::take_loop(next, e).size > 0;
    const int both = static_cast<int>(sides.size() + border_of(sides).size());
    const int euler = static_cast<int>(vertices.size()) - both / 2 + patch.triangles;
    ASSERT_EQ(euler, patch.diagonal >= 0 ? loops - 2 : loops) << index;
    for (int n = 0; n < patch.inner; ++n) ASSERT_TRUE(vertices.count(kFirstInner + n));
  });
}

TEST(TopologyTables, WithAllFacesJoinedTheyAreTheCaseTables) {
  const TopologyTables& tables = topology_tables();
  for (std::size_t index = 0; index < 256; ++index) {
    const CellPatch& patch = tables.patches[tables.cases[index].consistent_patch];
    ASSERT_EQ(patch.triangles, kCaseTables.triangles[index]);
    ASSERT_EQ(patch.inner, 0);
    ASSERT_TRUE(std::equal(tables.corners + patch.first,
                           tables.corners + patch.first + 3 * patch.triangles,
                           kCaseTables.edges[index].begin()));
  }
}

}  // namespace
}  // namespace isobrick

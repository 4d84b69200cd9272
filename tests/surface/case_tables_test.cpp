#include "surface/case_tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <vector>

namespace isobrick::inline v0 {
namespace {

using Segment = std::pair<int, int>;

bool inside(int index, int corner) { return (index >> corner & 1) != 0; }

std::pair<int, int> corners_of(int edge) {
  for (int a = 0; a < 8; ++a)
    for (int bit = 1; bit < 8; bit *= 2)
      if (!(a & bit) && case_rule::edge_between(a, a | bit) == edge) return {a, a | bit};
  return {-1, -1};
}

std::vector<std::array<int, 3>> triangles_of(int index) {
  std::vector<std::array<int, 3>> triangles;
  const auto& row = kCaseTables.edges[static_cast<std::size_t>(index)];
  for (std::size_t i = 0; i < kCaseTables.triangles[static_cast<std::size_t>(index)]; ++i)
    triangles.push_back({row[3 * i], row[3 * i + 1], row[3 * i + 2]});
  return triangles;
}

/// Directed sides that only one triangle of the case has: they lie on the cell's faces.
std::set<Segment> border_of(int index) {
  std::set<Segment> border;
  for (const auto& t : triangles_of(index))
    for (std::size_t i = 0; i < 3; ++i) {
      const Segment side{t[i], t[(i + 1) % 3]};
      if (!border.erase({side.second, side.first})) {
        EXPECT_TRUE(border.insert(side).second) << "side twice in case " << index;
      }
    }
  return border;
}

std::uint8_t faces_of(int edge) {
  static const auto faces = case_rule::faces_of_edges();
  return faces[static_cast<std::size_t>(edge)];
}

TEST(CaseTables, EdgesAreNumberedOneToOne) {
  std::set<int> seen;
  for (int e = 0; e < 12; ++e) {
    const auto [a, b] = corners_of(e);
    ASSERT_GE(a, 0);
    seen.insert(case_rule::edge_between(a, b));
    EXPECT_EQ(case_rule::edge_between(a, b), case_rule::edge_between(b, a));
  }
  EXPECT_EQ(seen.size(), 12u);
}

TEST(CaseTables, EveryCrossingEdgeAndNoOtherIsUsed) {
  for (int index = 0; index < 256; ++index) {
    std::set<int> used, crossing;
    for (const auto& t : triangles_of(index)) used.insert(t.begin(), t.end());
    for (int e = 0; e < 12; ++e) {
      const auto [a, b] = corners_of(e);
      if (inside(index, a) != inside(index, b)) crossing.insert(e);
    }
    EXPECT_EQ(used, crossing) << "case " << index;
    EXPECT_EQ(kCaseTables.edges[static_cast<std::size_t>(index)].back(), 15);
  }
}

// A second derivation of the rule, from the face's bits instead of a walk: an
// unambiguous face has one segment, an ambiguous one joins the inside corners.
std::set<std::set<int>> segments_by_rule(int index, int face) {
  const auto& c = case_rule::kFaces[face];
  std::set<std::set<int>> segments;
  std::vector<int> crossing;
  for (int i = 0; i < 4; ++i)
    if (inside(index, c[i]) != inside(index, c[(i + 1) % 4]))
      crossing.push_back(case_rule::edge_between(c[i], c[(i + 1) % 4]));
  if (crossing.size() == 2) segments.insert({crossing[0], crossing[1]});
  if (crossing.size() == 4)
    for (int i = 0; i < 4; ++i)
      if (!inside(index, c[i]))
        segments.insert({case_rule::edge_between(c[(i + 3) % 4], c[i]),
                         case_rule::edge_between(c[i], c[(i + 1) % 4])});
  return segments;
}

TEST(CaseTables, BordersAreTheSegmentsOfTheRule) {
  for (int index = 0; index < 256; ++index) {
    std::set<std::set<int>> expected, found;
    for (int face = 0; face < 6; ++face) expected.merge(segments_by_rule(index, face));
    for (const Segment& s : border_of(index)) {
      found.insert({s.first, s.second});
      EXPECT_NE(faces_of(s.first) & faces_of(s.second), 0) << "case " << index;
    }
    EXPECT_EQ(found, expected) << "case " << index;
  }
}

TEST(CaseTables, NoInnerSideLiesInAFace) {
  for (int index = 0; index < 256; ++index) {
    const std::set<Segment> border = border_of(index);
    for (const auto& t : triangles_of(index))
      for (std::size_t i = 0; i < 3; ++i) {
        const Segment side{t[i], t[(i + 1) % 3]};
        if (!border.count(side)) {
          EXPECT_EQ(faces_of(side.first) & faces_of(side.second), 0) << "case " << index;
        }
      }
  }
}

// Two cells that share a face have 12 corners: 4096 pairs. Along each axis the
// segments of one must be those of the other, reversed.
TEST(CaseTables, NeighboursMeetInAll4096PairsAlongEveryAxis) {
  for (int axis = 0; axis < 3; ++axis) {
    const int bit = 1 << axis;
    for (int pair = 0; pair < 4096; ++pair) {
      int low = 0, high = 0;  // the face of `low` at 1 is the face of `high` at 0
      int next = 0;
      for (int corner = 0; corner < 8; ++corner) low |= (pair >> next++ & 1) << corner;
      for (int corner = 0; corner < 8; ++corner)
        high |= (corner & bit ? pair >> next++ & 1 : low >> (corner | bit) & 1) << corner;
      std::set<Segment> from_low, from_high;
      for (const Segment& s : border_of(low)) {
        const auto [a, b] = corners_of(s.first);
        const auto [c, d] = corners_of(s.second);
        if (a & b & c & d & bit)
          from_low.insert({case_rule::edge_between(a & ~bit, b & ~bit),
                           case_rule::edge_between(c & ~bit, d & ~bit)});
      }
      for (const Segment& s : border_of(high)) {
        const auto [a, b] = corners_of(s.first);
        const auto [c, d] = corners_of(s.second);
        if (!((a | b | c | d) & bit)) from_high.insert({s.second, s.first});
      }
      ASSERT_EQ(from_low, from_high) << "axis " << axis << ", cases " << low << " and " << high;
    }
  }
}

TEST(CaseTables, TrianglesFaceTheOutside) {
  // Around a single inside corner at the origin the normal points away from it.
  const auto t = triangles_of(1);
  ASSERT_EQ(t.size(), 1u);
  const auto axis_of = [](int edge) { return edge / 4; };
  const std::array<int, 3> axes{axis_of(t[0][0]), axis_of(t[0][1]), axis_of(t[0][2])};
  const bool even =
      axes == std::array{0, 1, 2} || axes == std::array{1, 2, 0} || axes == std::array{2, 0, 1};
  EXPECT_TRUE(even);
}

TEST(CaseTables, TriangleCountsOfTheWidelyUsedTable) {
  int total = 0;
  for (const auto n : kCaseTables.triangles) total += n;
  EXPECT_EQ(total, 820);
  EXPECT_EQ(*std::max_element(kCaseTables.triangles.begin(), kCaseTables.triangles.end()), 5);
}

}  // namespace
}  // namespace isobrick

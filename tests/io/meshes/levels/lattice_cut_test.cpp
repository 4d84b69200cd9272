#include "io/meshes/levels/lattice_cut.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "io/meshes/levels/level_fragments.h"
#include "tests/io/meshes/levels/lattice_fixture.h"

namespace isobrick::test {
namespace {

constexpr std::int64_t kSteps = ChunkGrid::kSteps;

ChunkGrid cube_grid(std::uint32_t cells) { return {.cells = {cells, cells, cells}}; }

/// A tetrahedron, closed and outward.
std::vector<LatticeTriangle> tetrahedron(const std::array<LatticePoint, 4>& p) {
  return {{p[0], p[2], p[1]}, {p[0], p[1], p[3]}, {p[1], p[2], p[3]}, {p[2], p[0], p[3]}};
}

/// Where the planes of a cell are along an axis.
std::pair<std::int64_t, std::int64_t> range_of(std::uint32_t cell, std::uint32_t halves) {
  if (halves == 1) return {cell * kSteps, (cell + 1) * kSteps};
  const std::int64_t chunk = cell / 2 * kSteps, middle = chunk + ChunkGrid::kMiddle;
  return cell % 2 == 0 ? std::pair(chunk, middle) : std::pair(middle, chunk + kSteps);
}

/// Cuts triangles, and checks that each piece is in its cell.
std::vector<LatticeTriangle> cut_all(const std::vector<LatticeTriangle>& triangles,
                                     const ChunkGrid& grid, int level) {
  LatticeCut cut(grid, level);
  std::vector<LatticeTriangle> pieces;
  for (const LatticeTriangle& t : triangles) {
    std::set<GridCell> touched;
    cut.for_each_fragment(t, [&](const GridCell& cell) { touched.insert(cell); });
    const CutTriangle corners{{{t[0]}, {t[1]}, {t[2]}}};
    cut.for_each_piece(corners, [&](const CutTriangle& cut_piece, const GridCell& cell) {
      const LatticeTriangle piece{cut_piece[0].at, cut_piece[1].at, cut_piece[2].at};
      pieces.push_back(piece);
      for (const LatticePoint& p : piece)
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const auto [lo, hi] = range_of(cell[axis], cut.halves());
          EXPECT_GE(p[axis], lo);
          EXPECT_LE(p[axis], hi);
        }
      const GridCell fragment{cell[0] / cut.halves(), cell[1] / cut.halves(),
                              cell[2] / cut.halves()};
      EXPECT_TRUE(touched.contains(fragment)) << "a fragment would miss a piece";
    });
  }
  return pieces;
}

TEST(LatticeCut, ClosedSurfacesStayClosedAndKeepTheirVolume) {
  std::mt19937 random(7);
  for (int round = 0; round < 300; ++round) {
    const ChunkGrid grid = cube_grid(8);
    const int level = round % 3;
    const std::int64_t end = kSteps * grid.count(0, level);
    // Often on the planes themselves, where several cases meet.
    std::uniform_int_distribution<std::int64_t> anywhere(0, end), plane(0, 2 * end / kSteps),
        kind(0, 2);
    std::array<LatticePoint, 4> corners;
    for (LatticePoint& corner : corners)
      for (std::int64_t& x : corner) {
        const std::int64_t n = plane(random);
        x = kind(random) > 0 ? anywhere(random)
                             : std::min(end, n / 2 * kSteps + (n % 2) * ChunkGrid::kMiddle);
      }
    const std::vector<LatticeTriangle> whole = tetrahedron(corners);
    const std::vector<LatticeTriangle> pieces = cut_all(whole, grid, level);
    EXPECT_EQ(open_sides(pieces), 0U) << "round " << round;
    // Rounding moves each cut by half a step at most.
    const double size = static_cast<double>(end);
    EXPECT_NEAR(volume_of(pieces), volume_of(whole), 20 * size * size) << "round " << round;
  }
}

TEST(LatticeCut, ATriangleInAPlaneIsInOneCell) {
  const ChunkGrid grid = cube_grid(4);
  for (const int level : {0, 1}) {
    const std::int64_t end = kSteps * grid.count(0, level);
    for (const std::int64_t x : {std::int64_t{0}, kSteps, end}) {
      const LatticeTriangle flat{{{x, 10, 10}, {x, 1000, 10}, {x, 10, 1000}}};
      EXPECT_EQ(cut_all({flat}, grid, level).size(), 1U) << x;
      LatticeCut cut(grid, level);
      int fragments = 0;
      cut.for_each_fragment(flat, [&](const GridCell& cell) {
        ++fragments;
        EXPECT_LT(cell[0], grid.count(0, level));
      });
      EXPECT_EQ(fragments, 1);
    }
  }
}

TEST(LatticeCut, WhatLiesWithinAFragmentIsNotCut) {
  const LatticeTriangle t{{{1, 2, 3}, {kSteps, 5, 6}, {7, kSteps, 9}}};
  const auto pieces = cut_all({t}, cube_grid(2), 0);
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(pieces.front(), t);
}

TEST(LatticeCut, PiecesWithoutThreeCornersAreLeftOut) {
  const LatticeTriangle t{{{1, 2, 3}, {1, 2, 3}, {7, 8, 9}}};
  EXPECT_TRUE(cut_all({t}, cube_grid(2), 0).empty());
}

TEST(ChunkGrid, CoversTheMeshWithAsFewFragmentsAsItCan) {
  const ChunkGrid grid = make_chunk_grid({{-3, 0, 5}, {7, 4, 6}}, 3);
  EXPECT_EQ(grid.cells, (std::array<std::uint32_t, 3>{4, 2, 1}));
  EXPECT_FLOAT_EQ(grid.edge, 2.5F);
  EXPECT_EQ(grid.levels(), 3);
  EXPECT_EQ(grid.count(0, 1), 2U);
  EXPECT_EQ(grid.count(0, 2), 1U);
  EXPECT_EQ(grid.count(0, 9), 1U);
  EXPECT_EQ(grid.quantize({-3, 0, 5}, 0), (LatticePoint{0, 0, 0}));
  EXPECT_EQ(grid.quantize({7, 2.5F, 5}, 0), (LatticePoint{4 * kSteps, kSteps, 0}));
  EXPECT_EQ(grid.quantize({-4, 90, 5}, 0), (LatticePoint{0, 2 * kSteps, 0})) << "not outside";
}

TEST(ChunkGrid, TakesMeshesWithoutExtentAndFarAway) {
  for (const double at : {0.0, -1e6, 1e30}) {
    const ChunkGrid grid = make_chunk_grid({{at, at, at}, {at, at, at}}, 0);
    EXPECT_EQ(grid.levels(), 1);
    EXPECT_GT(grid.edge, 0);
    EXPECT_TRUE(std::isfinite(grid.edge));
  }
  const ChunkGrid fine = make_chunk_grid({{0, 0, 0}, {1, 1, 1}}, 1e-9);
  EXPECT_EQ(fine.cells[0], 32768U) << "no more than numbers of a lattice can count";
}

TEST(ZOrder, KeysAreReversibleAndXVariesFastest) {
  const GridCell cell{0x12345, 0x1fffff, 0x0f0f0};
  EXPECT_EQ(cell_of_key(z_order_key(cell)), cell);
  EXPECT_EQ(z_order_key({1, 0, 0}), 1U);
  EXPECT_EQ(z_order_key({0, 1, 0}), 2U);
  EXPECT_EQ(z_order_key({0, 0, 1}), 4U);
  EXPECT_EQ(z_order_key({2, 0, 0}), 8U);
}

}  // namespace
}  // namespace isobrick::test

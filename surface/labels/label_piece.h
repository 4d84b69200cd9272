#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <isobrick/label.h>
#include <isobrick/lattice.h>

namespace isobrick::inline v0 {

/// Cells of a tile and around it by number, x + kEdge · (y + kEdge · z): they begin kBefore cells
/// before the tile's first one.
struct TileCells {
  static constexpr int kBefore = 2;
  static constexpr int kEdge = static_cast<int>(kTileEdge) + 5;

  static constexpr int at(int x, int y, int z) { return x + kEdge * (y + kEdge * z); }
  static constexpr std::array<int, 3> place(int cell) {
    return {cell % kEdge, cell / kEdge % kEdge, cell / (kEdge * kEdge)};
  }
};

/// A vertex that a tile owns.
struct LabelVertex {
  std::uint32_t cell = 0;  ///< of TileCells
  Vec3f in_cell;           ///< from the cell's first corner, in samples

  friend bool operator==(const LabelVertex&, const LabelVertex&) = default;
};

/// A vertex that a neighbour above owns: the neighbour (3 bits, x the lowest), the cell among the
/// neighbour's TileCells (16 bits) and the label's sheet in it (2 bits).
struct ForeignVertex {
  std::uint32_t bits = 0;

  Int3 neighbour() const {
    return {static_cast<Index>(bits & 1), static_cast<Index>(bits >> 1 & 1),
            static_cast<Index>(bits >> 2 & 1)};
  }
  std::uint32_t cell() const { return bits >> 3 & 0xffff; }
  std::uint32_t sheet() const { return bits >> 19; }
};

/// Four vertices, counter-clockwise seen from outside the label; it is divided between the first
/// and the third. Numbers below the count of owned vertices are theirs, the others, less that
/// count, those of the foreign ones.
using LabelQuad = std::array<std::uint32_t, 4>;

/// What a tile has of one label.
struct LabelPiece {
  Label label;
  std::span<const LabelVertex> vertices;  ///< in the order of the cells, then of the sheets
  std::span<const ForeignVertex> foreign;
  std::span<const LabelQuad> quads;
};

}  // namespace isobrick

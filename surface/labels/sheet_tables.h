#pragma once

#include <array>
#include <cstdint>

#include "surface/case_rule.h"

// Sheets: the connected pieces of a label's boundary within a cell. Numbering of corners, edges and
// faces is that of case_rule.h. On an ambiguous face the label is cut in two, so that samples
// belong together that are neighbours along an axis.
//
// A sheet has one vertex (Nielson, "Dual marching cubes", 2004). Where a sheet passes the same face
// twice in both cells at that face, four quads would share a side. The face is then cut the other
// way in both cells, so each has two sheets there (Wenger, "Isosurfaces", 2013). Such a face closes
// a tunnel without width; the label is in one piece around it anyway.

namespace isobrick::inline v0 {

/// Vertices of a label in one cell at most.
inline constexpr int kMaxSheets = 4;
/// In place of a face.
inline constexpr std::uint8_t kNoFace = 6;

/// The sheets of a case: of the set of corners that have the label.
struct CellSheets {
  std::uint8_t count = 0;
  /// Of each active edge, 0 … count − 1; of the others 0.
  std::array<std::uint8_t, 12> of_edge{};
};

/// The sheets of all cases.
struct SheetTables {
  std::array<CellSheets, 256> sheets{};
  /// The face that a sheet passes twice, or kNoFace. It is the only ambiguous face of its case.
  std::array<std::uint8_t, 256> pinched_face{};
  /// The same case with the pinched face cut the other way.
  std::array<CellSheets, 256> split{};
};

namespace sheet_rule {

constexpr CellSheets sheets_of(int index, int joined) {
  auto next = case_rule::successors(index, joined);
  CellSheets sheets;
  for (int start = 0; start < 12; ++start) {
    const case_rule::Loop loop = case_rule::take_loop(next, start);
    if (loop.size == 0) continue;
    for (int i = 0; i < loop.size; ++i)
      sheets.of_edge[static_cast<std::size_t>(loop.edge[static_cast<std::size_t>(i)])] =
          sheets.count;
    ++sheets.count;
  }
  return sheets;
}

/// The ambiguous face whose four edges belong to one sheet.
constexpr std::uint8_t pinched_face(int index, const CellSheets& sheets) {
  const int ambiguous = case_rule::ambiguous_faces(index);
  for (int f = 0; f < 6; ++f) {
    if (!(ambiguous >> f & 1)) continue;
    const auto& c = case_rule::kFaces[f];
    const auto sheet = [&](int i) {
      return sheets
          .of_edge[static_cast<std::size_t>(case_rule::edge_between(c[i], c[(i + 1) % 4]))];
    };
    if (sheet(0) != sheet(1) || sheet(0) != sheet(2) || sheet(0) != sheet(3)) continue;
    if (ambiguous != 1 << f) throw "a case with a pinched face has other ambiguous faces";
    return static_cast<std::uint8_t>(f);
  }
  return kNoFace;
}

}  // namespace sheet_rule

/// Applies the rule to all cases. Fails to compile (or throws) if a case broke it.
constexpr SheetTables make_sheet_tables() {
  SheetTables tables;
  for (int index = 0; index < 256; ++index) {
    const auto i = static_cast<std::size_t>(index);
    tables.sheets[i] = sheet_rule::sheets_of(index, 0);
    tables.pinched_face[i] = sheet_rule::pinched_face(index, tables.sheets[i]);
    tables.split[i] = tables.sheets[i];
    if (const int face = tables.pinched_face[i]; face != kNoFace)
      tables.split[i] = sheet_rule::sheets_of(index, 1 << face);
    if (tables.split[i].count > kMaxSheets) throw "too many sheets";
  }
  return tables;
}

inline constexpr SheetTables kSheetTables = make_sheet_tables();

}  // namespace isobrick

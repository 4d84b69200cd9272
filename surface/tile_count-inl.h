// The counts of a tile; included once for every SIMD target.

#if defined(ISOBRICK_TILE_COUNT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_COUNT_INL_H_
#undef ISOBRICK_TILE_COUNT_INL_H_
#else
#define ISOBRICK_TILE_COUNT_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>

#include "surface/case_tables.h"
#include "surface/tile_classify-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The active edges that start in a row, and the cells that do.
struct RowEdges {
  std::uint64_t x, y, z, cells;
};

inline RowEdges edges_of_row(const TileState& tile, int y, int z) {
  const TileShape& s = tile.shape;
  const std::uint64_t cell_mask = bit_span(s.lo[0], s.hi[0] - 1);
  const std::uint64_t sample_mask = bit_span(s.lo[0], s.hi[0]);
  const std::uint64_t* inside = tile.inside + row_index(y, z);
  const bool up_y = y < s.hi[1], up_z = z < s.hi[2];
  const std::uint64_t here = inside[0];
  const std::uint64_t above = up_y ? inside[1] : here;
  const std::uint64_t behind = up_z ? inside[kTileSamples] : here;
  const std::uint64_t both = up_y && up_z ? inside[kTileSamples + 1] : here;
  const std::uint64_t any = here | above | behind | both;
  const std::uint64_t all = here & above & behind & both;
  const std::uint64_t active = (any | any >> 1) & ~(all & all >> 1) & cell_mask;
  return {(here ^ here >> 1) & cell_mask, (here ^ above) & sample_mask,
          (here ^ behind) & sample_mask, up_y && up_z ? active : 0};
}

/// Bit y: in row (y, z) an edge or a cell may begin that the surface passes; in
/// the others none does. Rows outside the tile's shape may have any bit.
inline std::uint64_t rows_with_surface(const TileState& tile, int z) {
  const hn::ScalableTag<std::uint64_t> d;
  const auto cells = hn::Set(d, bit_span(tile.shape.lo[0], tile.shape.hi[0] - 1));
  const auto samples = hn::Set(d, bit_span(tile.shape.lo[0], tile.shape.hi[0]));
  std::uint64_t found = 0;
  for (std::size_t y = 0; y < static_cast<std::size_t>(kTileSamples); y += hn::Lanes(d)) {
    const std::uint64_t* inside = tile.inside + row_index(0, z) + y;
    const auto here = hn::LoadU(d, inside), above = hn::LoadU(d, inside + 1);
    const auto behind = hn::LoadU(d, inside + kTileSamples);
    const auto both = hn::LoadU(d, inside + kTileSamples + 1);
    const auto along_x = hn::And(hn::Xor(here, hn::ShiftRight<1>(here)), cells);
    const auto across =
        hn::Or(hn::Or(hn::Xor(here, above), hn::Xor(here, behind)), hn::Xor(here, both));
    const auto any = hn::Or(along_x, hn::And(across, samples));
    std::uint8_t mask[8] = {};
    hn::StoreMaskBits(d, hn::Ne(any, hn::Zero(d)), mask);
    found |= static_cast<std::uint64_t>(mask[0]) << y;
  }
  return found;
}

/// Leaves out what touches NaN: cells with such a corner, and edges with no
/// other cell around them.
inline void leave_out_nan(const GoodCells& good, int y, int z, RowEdges& edges) {
  const std::uint64_t g00 = good.at(y - 1, z - 1), g10 = good.at(y, z - 1);
  const std::uint64_t g01 = good.at(y - 1, z), g11 = good.at(y, z);
  edges.x &= (g00 | g10 | g01 | g11) >> 1;
  edges.y &= (g10 | g11) >> 1 | (g10 | g11);
  edges.z &= (g01 | g11) >> 1 | (g01 | g11);
  edges.cells &= g11 >> 1;
}

/// Leaves out the edges with a coincident vertex at an end, whose vertices are not numbered with
/// the rest.
inline void leave_out_coincident(const CoincidentVertices& coincident, int y, int z,
                                 RowEdges& edges) {
  const std::uint64_t* at = coincident.at + row_index(y, z);
  edges.x &= ~(at[0] | at[0] >> 1);
  edges.y &= ~(at[0] | at[1]);
  edges.z &= ~(at[0] | at[kTileSamples]);
}

/// Lists the active cells of a row with their cases.
inline void list_cells(TileState& tile, int y, int z, std::uint64_t cells) {
  const std::uint64_t* inside = tile.inside + row_index(y, z);
  const std::uint64_t w0 = inside[0], w1 = inside[1];
  const std::uint64_t w2 = inside[kTileSamples], w3 = inside[kTileSamples + 1];
  const auto place = static_cast<ActiveCell>(y << 5 | z << 10);
  ActiveCell* out = tile.cells.end();
  std::uint32_t triangles = 0;
  for (; cells; cells &= cells - 1, ++out) {
    const int x = std::countr_zero(cells);
    const auto index = static_cast<std::uint32_t>((w0 >> x & 3) | (w1 >> x & 3) << 2 |
                                                  (w2 >> x & 3) << 4 | (w3 >> x & 3) << 6);
    triangles += kCaseTables.triangles[index];
    *out = place | static_cast<ActiveCell>(x) | index << 16;
  }
  tile.triangles += triangles;
  tile.cells.resize(static_cast<std::size_t>(out - tile.cells.begin()));
}

/// Numbers the tile's own vertices of a row, counting on from `number`.
inline std::uint32_t number_row(TileState& tile, int y, int z, const RowEdges& edges,
                                std::uint32_t number) {
  const TileShape& s = tile.shape;
  const bool own_y = y > 0 || s.first[1], own_z = z > 0 || s.first[2];
  EdgeRow& row = tile.rows[row_index(y, z)];
  const auto count = [](std::uint32_t word) {
    return static_cast<std::uint32_t>(std::popcount(word));
  };
  // Edges along y or z: the one at sample 0, if it is ours, then the word.
  const auto number_word = [&](std::uint64_t bits, std::uint32_t& word, std::uint32_t& at_0,
                               std::uint32_t& base) {
    const auto own = static_cast<std::uint8_t>(bits & s.first[0]);
    word = static_cast<std::uint32_t>(bits >> 1);
    at_0 = number;
    base = number + own;
    number = base + count(word);
    return own;
  };
  if (own_y && own_z) {
    row.x = static_cast<std::uint32_t>(edges.x);
    row.x_base = number;
    number += count(row.x);
  }
  std::uint8_t own_at_0 = 0;
  if (own_z) own_at_0 = number_word(edges.y, row.y, row.y_at_0, row.y_base);
  if (own_y)
    own_at_0 = static_cast<std::uint8_t>(own_at_0 |
                                         number_word(edges.z, row.z, row.z_at_0, row.z_base) << 1);
  tile.own_at_0[row_index(y, z)] = own_at_0;
  return number;
}

/// Numbers the vertices and lists the active cells, row by row. `leave_out(y, z, edges)` first
/// takes out what has none.
template <class LeaveOut>
HWY_INLINE void count_rows(TileState& tile, const LeaveOut& leave_out) {
  tile.clear_rows();
  tile.cells.clear();
  tile.cells.reserve(static_cast<std::size_t>(kTileEdge * kTileEdge * kTileEdge));
  tile.triangles = 0;
  std::uint32_t number = 0;
  const TileShape& s = tile.shape;
  for (int z = s.lo[2]; z <= s.hi[2]; ++z) {
    std::uint64_t rows = rows_with_surface(tile, z) & bit_span(s.lo[1], s.hi[1]);
    tile.written[z] = rows;
    for (; rows; rows &= rows - 1) {
      const int y = std::countr_zero(rows);
      RowEdges edges = edges_of_row(tile, y, z);
      if (!(edges.x | edges.y | edges.z | edges.cells)) continue;
      leave_out(y, z, edges);
      number = number_row(tile, y, z, edges, number);
      if (edges.cells) list_cells(tile, y, z, edges.cells);
    }
  }
  tile.edge_vertices = tile.vertices = number;
}

template <class T>
void count_tile(const KernelContext& context, TileState& tile) {
  classify_samples<T>(context, tile);
  GoodCells good;
  const bool look_for_nan = std::is_floating_point_v<T> && context.may_have_nan;
  if (look_for_nan) find_nan<T>(context, tile, good);
  count_rows(tile, [&](int y, int z, RowEdges& edges) HWY_ATTR {
    if (look_for_nan) leave_out_nan(good, y, z, edges);
    if (tile.coincident) leave_out_coincident(*tile.coincident, y, z, edges);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

// The first pass over a tile; included once for every SIMD target.

#if defined(ISOBRICK_TILE_SCAN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_SCAN_INL_H_
#undef ISOBRICK_TILE_SCAN_INL_H_
#else
#define ISOBRICK_TILE_SCAN_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstring>

#include "core/threshold.h"
#include "surface/case_tables.h"
#include "surface/coincident_vertices.h"
#include "surface/tile_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bits lo … hi.
constexpr std::uint64_t bit_span(int lo, int hi) {
  return (std::uint64_t{2} << hi) - (std::uint64_t{1} << lo);
}

/// Bit x: compare(samples[x]), for the 33 samples of a row. `compare` takes vectors.
template <class T, class Compare>
HWY_INLINE std::uint64_t row_of_bits(const T* samples, const Compare& compare) {
  const hn::CappedTag<T, 32> d;
  std::uint64_t bits = 0;
  for (std::size_t x = 0; x < 32; x += hn::Lanes(d)) {
    std::uint8_t mask[8] = {};
    hn::StoreMaskBits(d, compare(d, hn::LoadU(d, samples + x)), mask);
    std::uint64_t word;
    std::memcpy(&word, mask, 8);
    bits |= word << x;
  }
  return bits;
}

/// Bit x: samples[x] >= threshold.
template <class T>
HWY_INLINE std::uint64_t inside_bits(const T* samples, T threshold) {
  const std::uint64_t bits = row_of_bits(samples, [&](auto d, auto v) HWY_ATTR {
    const auto limit = hn::Set(d, threshold);
    if constexpr (std::is_floating_point_v<T>)
      return hn::Ge(v, limit);
    else
      return hn::Not(hn::Lt(v, limit));
  });
  return bits | static_cast<std::uint64_t>(samples[32] >= threshold) << 32;
}

/// Bit x: samples[x] == value.
template <class T>
HWY_INLINE std::uint64_t equal_bits(const T* samples, T value) {
  const std::uint64_t bits =
      row_of_bits(samples, [&](auto d, auto v) HWY_ATTR { return hn::Eq(v, hn::Set(d, value)); });
  return bits | static_cast<std::uint64_t>(samples[32] == value) << 32;
}

/// Bit x + 1: samples[x] is not a number, for x = −1 … 33.
template <class T>
inline std::uint64_t nan_bits(const T* samples) {
  std::uint64_t bits = 0;
  for (int x = -1; x <= kTileSamples; ++x)
    bits |= static_cast<std::uint64_t>(samples[x] != samples[x]) << (x + 1);
  return bits;
}

/// Inside bits of all rows. Blocks that are not active were not gathered; all
/// their samples lie on the side of the sample that the tile's blocks share.
template <class T>
void classify(const KernelContext& context, TileState& tile) {
  const T threshold = Threshold<T>(context.isovalue).value;
  const std::optional<T> coincident = coincident_value<T>(context.isovalue);
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());
  const Int3 common = common_sample(context.extent, tile.work.tile);
  const T known = samples[TileLayout::offset(static_cast<int>(common.x), static_cast<int>(common.y),
                                             static_cast<int>(common.z))];
  const std::uint64_t rest = known >= threshold ? bit_span(0, kTileSamples - 1) : 0;
  // Sample 16 belongs to the blocks on both sides, and either gathers it.
  constexpr int middle = static_cast<int>(kBlockEdge);
  constexpr std::uint64_t low = bit_span(0, middle), high = bit_span(middle, kTileSamples - 1);
  const auto blocks_at = [](int i) { return (i <= middle ? 1 : 0) | (i >= middle ? 2 : 0); };
  for (int z = tile.shape.lo[2]; z <= tile.shape.hi[2]; ++z) {
    const int of_z = (blocks_at(z) & 1 ? tile.work.active_blocks & 15 : 0) |
                     (blocks_at(z) & 2 ? tile.work.active_blocks >> 4 : 0);
    for (int y = tile.shape.lo[1]; y <= tile.shape.hi[1]; ++y) {
      const int active = (blocks_at(y) & 1 ? of_z & 3 : 0) | (blocks_at(y) & 2 ? of_z >> 2 : 0);
      const std::uint64_t gathered = (active & 1 ? low : 0) | (active & 2 ? high : 0);
      std::uint64_t bits = rest & ~gathered;
      const T* row = samples + TileLayout::offset(0, y, z);
      if (gathered) bits |= gathered & inside_bits(row, threshold);
      tile.inside[row_index(y, z)] = bits;
      if (tile.coincident)
        tile.coincident->at[row_index(y, z)] =
            gathered ? gathered & equal_bits(row, *coincident) : 0;
    }
  }
}

/// Cells without a NaN corner around the tile, as rows of bits: row (y, z) and
/// bit x + 1 for cell (x, y, z), each in −1 … 32. Cells outside the region of
/// interest count as bad.
struct GoodCells {
  static constexpr int kEdge = kTileSamples + 1;
  std::uint64_t rows[kEdge * kEdge];
  std::uint64_t at(int y, int z) const { return rows[(z + 1) * kEdge + y + 1]; }
};

template <class T>
void find_good_cells(const KernelContext& context, const TileState& tile, GoodCells& good) {
  constexpr int edge = kTileSamples + 2;  // samples −1 … 33
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());
  std::uint64_t nan[edge * edge];
  const auto exists = [&](int axis, int i) {
    const Index p = tile.shape.origin[axis] + i;
    return p >= context.roi.lo[axis] && p < context.roi.hi[axis];
  };
  std::uint64_t columns = 0;
  for (int x = -1; x <= kTileSamples; ++x)
    columns |= static_cast<std::uint64_t>(exists(0, x)) << (x + 1);
  for (int z = -1; z <= kTileSamples; ++z)
    for (int y = -1; y <= kTileSamples; ++y)
      nan[(z + 1) * edge + y + 1] = exists(1, y) && exists(2, z)
                                        ? nan_bits(samples + TileLayout::offset(0, y, z)) | ~columns
                                        : ~std::uint64_t{0};
  for (int z = 0; z < GoodCells::kEdge; ++z)
    for (int y = 0; y < GoodCells::kEdge; ++y) {
      const std::uint64_t any = nan[z * edge + y] | nan[z * edge + y + 1] |
                                nan[(z + 1) * edge + y] | nan[(z + 1) * edge + y + 1];
      good.rows[z * GoodCells::kEdge + y] = ~(any | any >> 1);
    }
}

/// The active edges that start in a row, and the cells that do.
struct RowBits {
  std::uint64_t x, y, z, cells;
};

inline RowBits row_bits(const TileState& tile, int y, int z) {
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
  const std::uint64_t mixed = (any | any >> 1) & ~(all & all >> 1) & cell_mask;
  return {(here ^ here >> 1) & cell_mask, (here ^ above) & sample_mask,
          (here ^ behind) & sample_mask, up_y && up_z ? mixed : 0};
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
inline void leave_out_nan(const GoodCells& good, int y, int z, RowBits& bits) {
  const std::uint64_t g00 = good.at(y - 1, z - 1), g10 = good.at(y, z - 1);
  const std::uint64_t g01 = good.at(y - 1, z), g11 = good.at(y, z);
  bits.x &= (g00 | g10 | g01 | g11) >> 1;
  bits.y &= (g10 | g11) >> 1 | (g10 | g11);
  bits.z &= (g01 | g11) >> 1 | (g01 | g11);
  bits.cells &= g11 >> 1;
}

/// Leaves out the edges with a coincident vertex at an end, whose vertices are not numbered with
/// the rest.
inline void leave_out_coincident(const CoincidentVertices& coincident, int y, int z,
                                 RowBits& bits) {
  const std::uint64_t* at = coincident.at + row_index(y, z);
  bits.x &= ~(at[0] | at[0] >> 1);
  bits.y &= ~(at[0] | at[1]);
  bits.z &= ~(at[0] | at[kTileSamples]);
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
inline std::uint32_t number_row(TileState& tile, int y, int z, const RowBits& bits,
                                std::uint32_t number) {
  const TileShape& s = tile.shape;
  const bool own_y = y > 0 || s.first[1], own_z = z > 0 || s.first[2];
  EdgeRow& row = tile.rows[row_index(y, z)];
  const auto count = [](std::uint32_t word) {
    return static_cast<std::uint32_t>(std::popcount(word));
  };
  // Edges along y or z: the one at sample 0, if it is ours, then the word.
  const auto number_word = [&](std::uint64_t edges, std::uint32_t& word, std::uint32_t& at_0,
                               std::uint32_t& base) {
    const auto own = static_cast<std::uint8_t>(edges & s.first[0]);
    word = static_cast<std::uint32_t>(edges >> 1);
    at_0 = number;
    base = number + own;
    number = base + count(word);
    return own;
  };
  if (own_y && own_z) {
    row.x = static_cast<std::uint32_t>(bits.x);
    row.x_base = number;
    number += count(row.x);
  }
  std::uint8_t own_at_0 = 0;
  if (own_z) own_at_0 = number_word(bits.y, row.y, row.y_at_0, row.y_base);
  if (own_y)
    own_at_0 = static_cast<std::uint8_t>(own_at_0 |
                                         number_word(bits.z, row.z, row.z_at_0, row.z_base) << 1);
  tile.own_at_0[row_index(y, z)] = own_at_0;
  return number;
}

template <class T>
void scan_samples(const KernelContext& context, TileState& tile) {
  classify<T>(context, tile);
  GoodCells good;
  const bool look_for_nan = std::is_floating_point_v<T> && context.may_have_nan;
  if (look_for_nan) find_good_cells<T>(context, tile, good);

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
      RowBits bits = row_bits(tile, y, z);
      if (!(bits.x | bits.y | bits.z | bits.cells)) continue;
      if (look_for_nan) leave_out_nan(good, y, z, bits);
      if (tile.coincident) leave_out_coincident(*tile.coincident, y, z, bits);
      number = number_row(tile, y, z, bits, number);
      if (bits.cells) list_cells(tile, y, z, bits.cells);
    }
  }
  tile.edge_vertices = tile.vertices = number;
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

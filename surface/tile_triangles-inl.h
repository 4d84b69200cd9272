// The triangles of a tile; included once for every SIMD target.

#if defined(ISOBRICK_TILE_TRIANGLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_TRIANGLES_INL_H_
#undef ISOBRICK_TILE_TRIANGLES_INL_H_
#else
#define ISOBRICK_TILE_TRIANGLES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstring>

#include "surface/case_tables.h"
#include "surface/tile_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// For a cell at x, the bits of each word that come before its edge. A word
/// along y or z starts at sample 1, hence the shift for the edges at sample x.
struct alignas(64) BeforeMasks {
  std::uint32_t at[32][16];
  constexpr BeforeMasks() : at{} {
    for (int x = 0; x < 32; ++x)
      for (int e = 0; e < 16; ++e) {
        const std::uint32_t before = (std::uint32_t{1} << x) - 1;
        at[x][e] = e < 4 || (e & 1) ? before : before >> 1;
      }
  }
};
inline constexpr BeforeMasks kBefore;

#if HWY_TARGET <= HWY_AVX3_DL && HWY_ARCH_X86

// Sixteen lanes hold the twelve edges of a cell and the fifteen corners of its
// triangles: one population count numbers them, one permutation per cell writes
// them.
using Wide = hn::CappedTag<std::uint32_t, 16>;

/// Two rows that lie next to each other in memory are one vector. `from_first`
/// and `from_second` name lanes of the vectors of the rows at z and z + 1.
struct WideRow {
  hn::Vec<Wide> words, bases, bases_at_0;

  HWY_INLINE static hn::Vec<Wide> pick(hn::Vec<Wide> first, hn::Vec<Wide> second,
                                       const std::uint32_t (&lanes)[16]) {
    const Wide d;
    const auto index = hn::LoadU(d, lanes);
    const auto inner = hn::IndicesFromVec(d, hn::And(index, hn::Set(d, 15u)));
    return hn::IfThenElse(hn::Gt(index, hn::Set(d, 15u)), hn::TableLookupLanes(second, inner),
                          hn::TableLookupLanes(first, inner));
  }

  HWY_INLINE void load(const EdgeRow* rows, int y, int z) {
    // Members of EdgeRow: 0 x, 1 y, 2 z, 3–5 their bases, 6 y_at_0, 7 z_at_0.
    static constexpr std::uint32_t kWords[16] = {0, 8, 16, 24, 1, 1, 17, 17, 2, 2, 10, 10};
    static constexpr std::uint32_t kBases[16] = {3, 11, 19, 27, 4, 4, 20, 20, 5, 5, 13, 13};
    static constexpr std::uint32_t kBasesAt0[16] = {3, 11, 19, 27, 6, 4, 22, 20, 7, 5, 15, 13};
    static_assert(sizeof(EdgeRow) == 32);
    const Wide d;
    const auto* lanes = reinterpret_cast<const std::uint32_t*>(rows + row_index(y, z));
    const auto first = hn::LoadU(d, lanes), second = hn::LoadU(d, lanes + 8 * kTileSamples);
    words = pick(first, second, kWords);
    bases = pick(first, second, kBases);
    bases_at_0 = pick(first, second, kBasesAt0);
  }
};

/// The vertex numbers of the edges of cells that come row by row.
class CellNumbers {
 public:
  HWY_INLINE explicit CellNumbers(const TileState& tile) : rows_(tile.rows) {}

  /// Those that are not active get anything.
  HWY_INLINE void find(ActiveCell cell, std::uint32_t (&numbers)[16]) {
    if ((cell >> 5 & 0x3ff) != place_) {
      place_ = cell >> 5 & 0x3ff;
      row_.load(rows_, static_cast<int>(place_ & 31), static_cast<int>(place_ >> 5));
    }
    const Wide d;
    const std::uint32_t x = cell & 31;
    const auto before = hn::And(row_.words, hn::Load(d, kBefore.at[x]));
    hn::StoreU(hn::Add(x == 0 ? row_.bases_at_0 : row_.bases, hn::PopulationCount(before)), d,
               numbers);
  }

 private:
  const EdgeRow* rows_;
  WideRow row_;
  ActiveCell place_ = ~ActiveCell{0};
};

inline void write_triangles(const CaseTables& tables, const TileState& tile, Triangle* out) {
  const Wide d;
  WideRow row;
  row.load(tile.rows, 0, 0);
  ActiveCell place = 0;
  auto* to = reinterpret_cast<std::uint32_t*>(out);
  // A store of sixteen runs over what comes next, so the last ones are careful.
  const std::uint32_t* const careful = to + 3 * std::uint64_t{tile.triangles} - 15;
  for (const ActiveCell cell : tile.cells) {
    if ((cell >> 5 & 0x3ff) != place) {
      place = cell >> 5 & 0x3ff;
      row.load(tile.rows, static_cast<int>(place & 31), static_cast<int>(place >> 5));
    }
    const std::uint32_t x = cell & 31, index = cell >> 16;
    const auto before = hn::And(row.words, hn::Load(d, kBefore.at[x]));
    const auto ids = hn::Add(x == 0 ? row.bases_at_0 : row.bases, hn::PopulationCount(before));
    const hn::Rebind<std::uint8_t, Wide> d8;
    const auto edges = hn::PromoteTo(d, hn::LoadU(d8, tables.edges[index].data()));
    const auto corners = hn::TableLookupLanes(ids, hn::IndicesFromVec(d, edges));
    const std::uint32_t n = std::uint32_t{3} * tables.triangles[index];
    if (to < careful) {
      hn::StoreU(corners, d, to);
    } else {
      alignas(64) std::uint32_t last[16];
      hn::Store(corners, d, last);
      std::memcpy(to, last, n * sizeof *last);
    }
    to += n;
  }
}

#else

/// The twelve edges of the cells of one row: in the order of the case tables
/// the words to count in, and the number of the first vertex of each word.
struct alignas(64) CellRow {
  std::uint32_t words[16] = {}, bases[16] = {}, bases_at_0[16] = {};

  HWY_INLINE void load(const EdgeRow* rows, int y, int z) {
    const EdgeRow* r = rows + row_index(y, z);
    const EdgeRow &r00 = r[0], &r10 = r[1], &r01 = r[kTileSamples], &r11 = r[kTileSamples + 1];
    const EdgeRow* along_x[4] = {&r00, &r10, &r01, &r11};
    for (int i = 0; i < 4; ++i) {
      words[i] = along_x[i]->x;
      bases[i] = bases_at_0[i] = along_x[i]->x_base;
    }
    const EdgeRow* along_y[2] = {&r00, &r01};
    const EdgeRow* along_z[2] = {&r00, &r10};
    for (int i = 0; i < 2; ++i) {
      words[4 + 2 * i] = words[5 + 2 * i] = along_y[i]->y;
      bases[4 + 2 * i] = bases[5 + 2 * i] = bases_at_0[5 + 2 * i] = along_y[i]->y_base;
      bases_at_0[4 + 2 * i] = along_y[i]->y_at_0;
      words[8 + 2 * i] = words[9 + 2 * i] = along_z[i]->z;
      bases[8 + 2 * i] = bases[9 + 2 * i] = bases_at_0[9 + 2 * i] = along_z[i]->z_base;
      bases_at_0[8 + 2 * i] = along_z[i]->z_at_0;
    }
  }
};

/// Vertex numbers of a cell's edges; those that don't cross hold anything.
HWY_INLINE void cell_vertices(const CellRow& row, std::uint32_t x, std::uint32_t* ids) {
  const std::uint32_t* bases = x == 0 ? row.bases_at_0 : row.bases;
  const hn::CappedTag<std::uint32_t, 16> d;
  for (std::size_t i = 0; i < 12; i += hn::Lanes(d)) {
    const auto before = hn::And(hn::Load(d, row.words + i), hn::Load(d, kBefore.at[x] + i));
    hn::Store(hn::Add(hn::Load(d, bases + i), hn::PopulationCount(before)), d, ids + i);
  }
}

/// The vertex numbers of the edges of cells that come row by row.
class CellNumbers {
 public:
  HWY_INLINE explicit CellNumbers(const TileState& tile) : rows_(tile.rows) {}

  /// Those that are not active get anything.
  HWY_INLINE void find(ActiveCell cell, std::uint32_t (&numbers)[16]) {
    if ((cell >> 5 & 0x3ff) != place_) {
      place_ = cell >> 5 & 0x3ff;
      row_.load(rows_, static_cast<int>(place_ & 31), static_cast<int>(place_ >> 5));
    }
    cell_vertices(row_, cell & 31, numbers);
  }

 private:
  const EdgeRow* rows_;
  CellRow row_;
  ActiveCell place_ = ~ActiveCell{0};
};

inline void write_triangles(const CaseTables& tables, const TileState& tile, Triangle* out) {
  CellNumbers numbers(tile);
  alignas(64) std::uint32_t ids[16];
  for (const ActiveCell cell : tile.cells) {
    numbers.find(cell, ids);
    const std::uint32_t index = cell >> 16;
    const std::uint8_t* edges = tables.edges[index].data();
    for (int n = tables.triangles[index]; n > 0; --n, edges += 3)
      *out++ = {ids[edges[0]], ids[edges[1]], ids[edges[2]]};
  }
}

#endif  // sixteen lanes

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

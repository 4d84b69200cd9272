// The second pass over a tile; included once for every SIMD target.

#if defined(ISOBRICK_TILE_EMIT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_EMIT_INL_H_
#undef ISOBRICK_TILE_EMIT_INL_H_
#else
#define ISOBRICK_TILE_EMIT_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstring>

#include "isobrick/surface/case_tables.h"
#include "isobrick/surface/tile_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Everything about a tile that its vertices need.
template <class T>
struct VertexWriter {
  using R = Real<T>;
  const KernelContext& context;
  const TileState& tile;
  R iso;
  Vec3f* position;
  Vec3f* normal;  ///< or null

  static constexpr int kStep[3] = {1, TileLayout::kRow, TileLayout::kPlane};

  /// Central difference along `axis`, one-sided at the volume's border.
  HWY_INLINE float difference(const T* p, int axis, Index at) const {
    const Index last = context.extent[axis] - 1;
    const int before = at > 0 ? kStep[axis] : 0, after = at < last ? kStep[axis] : 0;
    const R d = static_cast<R>(p[after]) - static_cast<R>(p[-before]);
    return static_cast<float>(before && after ? d * R(0.5) : d);
  }

  HWY_INLINE Vec3f gradient(const T* p, Int3 at) const {
    return {difference(p, 0, at.x), difference(p, 1, at.y), difference(p, 2, at.z)};
  }

  template <int Axis>
  HWY_INLINE void write(const T* p, int x, int y, int z) {
    const R a = static_cast<R>(p[0]), b = static_cast<R>(p[kStep[Axis]]);
    const float t = static_cast<float>(std::is_floating_point_v<T> ? crossing(a, b, iso)
                                                                   : (iso - a) / (b - a));
    const Int3 at = tile.shape.origin + Int3{x, y, z};
    Vec3f where{static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)};
    (Axis == 0 ? where.x : Axis == 1 ? where.y : where.z) += t;
    *position++ = context.world.position(where);
    if (!normal) return;
    Int3 next = at;
    next[Axis] += 1;
    const Vec3f ga = gradient(p, at), gb = gradient(p + kStep[Axis], next);
    const Vec3f g{ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)};
    Vec3f along{0, 0, 0};
    along[Axis] = b > a ? 1.0f : -1.0f;
    *normal++ = context.world.unit_normal(g, along);
  }
};

template <class T>
void emit_vertices(const KernelContext& context, const TileState& tile, Vec3f* positions,
                   Vec3f* normals) {
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());
  VertexWriter<T> out{context, tile, static_cast<Real<T>>(context.isovalue), positions, normals};
  const TileShape& s = tile.shape;
  for (int z = s.lo[2]; z <= s.hi[2]; ++z) {
    const bool own_z = z > 0 || s.first[2];
    for (int y = s.lo[1]; y <= s.hi[1]; ++y) {
      const bool own_y = y > 0 || s.first[1];
      const int r = row_index(y, z);
      const EdgeRow& row = tile.rows[r];
      const T* p = samples + TileLayout::offset(0, y, z);
      if (own_y && own_z)
        for (std::uint32_t w = row.x; w; w &= w - 1) {
          const int x = std::countr_zero(w);
          out.template write<0>(p + x, x, y, z);
        }
      if (own_z) {
        if (tile.own_at_0[r] & 1) out.template write<1>(p, 0, y, z);
        for (std::uint32_t w = row.y; w; w &= w - 1) {
          const int x = std::countr_zero(w) + 1;
          out.template write<1>(p + x, x, y, z);
        }
      }
      if (own_y) {
        if (tile.own_at_0[r] & 2) out.template write<2>(p, 0, y, z);
        for (std::uint32_t w = row.z; w; w &= w - 1) {
          const int x = std::countr_zero(w) + 1;
          out.template write<2>(p + x, x, y, z);
        }
      }
    }
  }
}

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

/// Vertex numbers of a cell's edges; those that don't cross hold anything.
HWY_INLINE void cell_vertices(const CellRow& row, std::uint32_t x, std::uint32_t* ids) {
  const std::uint32_t* bases = x == 0 ? row.bases_at_0 : row.bases;
  const hn::CappedTag<std::uint32_t, 16> d;
  for (std::size_t i = 0; i < 12; i += hn::Lanes(d)) {
    const auto before = hn::And(hn::Load(d, row.words + i), hn::Load(d, kBefore.at[x] + i));
    hn::Store(hn::Add(hn::Load(d, bases + i), hn::PopulationCount(before)), d, ids + i);
  }
}

inline void emit_triangles(const TileState& tile, Triangle* out) {
  CellRow row;
  ActiveCell place = ~ActiveCell{0};
  alignas(64) std::uint32_t ids[16];
  for (const ActiveCell cell : tile.cells) {
    if ((cell >> 5 & 0x3ff) != place) {
      place = cell >> 5 & 0x3ff;
      row.load(tile.rows, static_cast<int>(place & 31), static_cast<int>(place >> 5));
    }
    cell_vertices(row, cell & 31, ids);
    const std::uint32_t index = cell >> 16;
    const std::uint8_t* edges = kCaseTables.edges[index].data();
    for (int n = kCaseTables.triangles[index]; n > 0; --n, edges += 3)
      *out++ = {ids[edges[0]], ids[edges[1]], ids[edges[2]]};
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

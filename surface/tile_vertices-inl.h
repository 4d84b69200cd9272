// The vertices of a tile; included once for every SIMD target.

#if defined(ISOBRICK_TILE_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_VERTICES_INL_H_
#undef ISOBRICK_TILE_VERTICES_INL_H_
#else
#define ISOBRICK_TILE_VERTICES_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstring>

#include "core/threshold.h"
#include "surface/tile_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Lists the tile's own edges in the order in which count_tile() numbered them.
inline void list_edges(TileState& tile) {
  const TileShape& s = tile.shape;
  tile.edges.resize(tile.edge_vertices);
  std::uint32_t* out = tile.edges.data();
  const auto append = [&out](std::uint32_t word, std::uint32_t code) {
    for (; word; word &= word - 1)
      *out++ = code + static_cast<std::uint32_t>(std::countr_zero(word));
  };
  const auto append_row = [&](int y, int z) {
    const bool own_y = y > 0 || s.first[1], own_z = z > 0 || s.first[2];
    const EdgeRow& row = tile.rows[row_index(y, z)];
    const std::uint8_t at_0 = tile.own_at_0[row_index(y, z)];
    const auto code = static_cast<std::uint32_t>(y << 6 | z << 12);
    if (own_y && own_z) append(row.x, code);
    if (own_z) {
      if (at_0 & 1) *out++ = code | 1u << 18;
      append(row.y, (code | 1u << 18) + 1);
    }
    if (own_y) {
      if (at_0 & 2) *out++ = code | 2u << 18;
      append(row.z, (code | 2u << 18) + 1);
    }
  };
  // Not for_each_written: what is compiled for other processors is not inlined.
  for (int z = s.lo[2]; z <= s.hi[2]; ++z)
    for (std::uint64_t rows = tile.written[z]; rows; rows &= rows - 1)
      append_row(std::countr_zero(rows), z);
}

/// Vertices one by one: the definition, which the vectors below follow to the bit.
template <class T>
struct ScalarVertices {
  using R = Real<T>;
  const KernelContext& context;
  const TileState& tile;
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());

  static constexpr int kStep[3] = {1, TileLayout::kRow, TileLayout::kPlane};

  /// Central difference along `axis`, one-sided at the volume's border.
  float difference(const T* p, int axis, Index at) const {
    const Index last = context.extent[axis] - 1;
    const int before = at > 0 ? kStep[axis] : 0, after = at < last ? kStep[axis] : 0;
    const R d = static_cast<R>(p[after]) - static_cast<R>(p[-before]);
    return static_cast<float>(d * (before && after ? R(0.5) : R(1)));
  }

  Vec3f gradient(const T* p, Int3 at) const {
    return {difference(p, 0, at.x), difference(p, 1, at.y), difference(p, 2, at.z)};
  }

  void write(std::uint32_t edge, Vec3f* position, Vec3f* normal) const {
    const int x = edge & 63, y = edge >> 6 & 63, z = edge >> 12 & 63,
              axis = static_cast<int>(edge >> 18);
    const T* p = samples + TileLayout::offset(x, y, z);
    const R a = static_cast<R>(p[0]), b = static_cast<R>(p[kStep[axis]]);
    const R iso = static_cast<R>(context.isovalue);
    const float t = static_cast<float>(std::is_floating_point_v<T> ? edge_parameter(a, b, iso)
                                                                   : (iso - a) / (b - a));
    const Int3 at = tile.shape.origin + Int3{x, y, z};
    Vec3f where{static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)};
    where[axis] += t;
    *position = context.world.position(where);
    if (!normal) return;
    Int3 next = at;
    next[axis] += 1;
    const Vec3f ga = gradient(p, at), gb = gradient(p + kStep[axis], next);
    const Vec3f g{ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)};
    Vec3f along{0, 0, 0};
    along[axis] = b > a ? 1.0f : -1.0f;
    *normal = context.world.unit_normal(g, along);
  }

  /// A vertex on the sample at place x | y << 6 | z << 12. Where its gradient
  /// vanishes, the normal is along its first active edge: −x, +x, −y …
  void write_sample(std::uint32_t place, Vec3f* position, Vec3f* normal) const {
    const int x = place & 63, y = place >> 6 & 63, z = place >> 12 & 63;
    const T* p = samples + TileLayout::offset(x, y, z);
    const Int3 at = tile.shape.origin + Int3{x, y, z};
    *position = context.world.position(
        {static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)});
    if (normal) *normal = context.world.unit_normal(gradient(p, at), first_active_edge(p, at));
  }

  Vec3f first_active_edge(const T* p, Int3 at) const {
    const T threshold = Threshold<T>(context.isovalue).value;
    Vec3f along{0, 0, 0};
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {-1, 1}) {
        const Index next = at[axis] + side;
        if (next < 0 || next >= context.extent[axis]) continue;
        const T q = p[side * kStep[axis]];
        if (q != q || (q >= threshold) == (*p >= threshold)) continue;
        along[axis] = static_cast<float>(q > *p ? side : -side);
        return along;
      }
    return along;
  }
};

#if HWY_TARGET != HWY_SCALAR  // whose vectors of one lane gain nothing
using F = hn::ScalableTag<float>;
using I = hn::RebindToSigned<F>;
using VF = hn::Vec<F>;
using VI = hn::Vec<I>;

/// Samples of the types that are interpolated in float, as many as a vector of floats.
template <class T>
struct FloatSamples {
  using Values = VF;

  /// Samples at these offsets. Narrow ones are fetched four bytes at a time,
  /// which the layout leaves room for.
  static HWY_INLINE Values load(const T* base, VI offset) {
    const F f;
    const I i;
    if constexpr (std::is_same_v<T, float>) {
      return hn::GatherIndex(f, base, offset);
    } else {
      constexpr int bits = 8 * static_cast<int>(sizeof(T));
      const VI bytes = sizeof(T) == 1 ? offset : hn::Add(offset, offset);
      const VI word = hn::GatherOffset(i, reinterpret_cast<const std::int32_t*>(base), bytes);
      if constexpr (std::is_signed_v<T>)
        return hn::ConvertTo(f, hn::ShiftRight<32 - bits>(hn::ShiftLeft<32 - bits>(word)));
      else
        return hn::ConvertTo(f, hn::And(word, hn::Set(i, (1 << bits) - 1)));
    }
  }
  static HWY_INLINE Values set(double value) { return hn::Set(F(), static_cast<float>(value)); }
  static HWY_INLINE Values subtract(Values a, Values b) { return hn::Sub(a, b); }
  static HWY_INLINE Values divide(Values a, Values b) { return hn::Div(a, b); }
  static HWY_INLINE VF times(Values a, VF factor) { return hn::Mul(a, factor); }
  static HWY_INLINE VF to_float(Values a) { return a; }
  static HWY_INLINE bool are_finite(Values a) {
    return hn::AllTrue(F(), hn::Le(hn::Abs(a), hn::Set(F(), std::numeric_limits<float>::max())));
  }
};

/// The same for the types that are interpolated in double: two vectors of doubles.
template <class T>
struct DoubleSamples {
  using D = hn::Repartition<double, F>;
  using HalfF = hn::Half<F>;
  using HalfI = hn::Half<I>;
  struct Values {
    hn::Vec<D> low, high;
  };

  static HWY_INLINE Values load(const T* base, VI offset) {
    const D d;
    const HalfI half;
    if constexpr (std::is_same_v<T, double>) {
      const hn::RebindToSigned<D> wide;
      return {hn::GatherIndex(d, base, hn::PromoteTo(wide, hn::LowerHalf(half, offset))),
              hn::GatherIndex(d, base, hn::PromoteTo(wide, hn::UpperHalf(half, offset)))};
    } else {
      const I i;
      VI word = hn::GatherIndex(i, reinterpret_cast<const std::int32_t*>(base), offset);
      if constexpr (std::is_unsigned_v<T>)
        word = hn::Xor(word, hn::Set(i, std::numeric_limits<std::int32_t>::min()));
      const hn::Vec<D> middle = hn::Set(d, std::is_unsigned_v<T> ? 2147483648.0 : 0.0);
      return {hn::Add(hn::PromoteTo(d, hn::LowerHalf(half, word)), middle),
              hn::Add(hn::PromoteTo(d, hn::UpperHalf(half, word)), middle)};
    }
  }
  static HWY_INLINE Values set(double value) { return {hn::Set(D(), value), hn::Set(D(), value)}; }
  static HWY_INLINE Values subtract(Values a, Values b) {
    return {hn::Sub(a.low, b.low), hn::Sub(a.high, b.high)};
  }
  static HWY_INLINE Values divide(Values a, Values b) {
    return {hn::Div(a.low, b.low), hn::Div(a.high, b.high)};
  }
  static HWY_INLINE VF times(Values a, VF factor) {
    const D d;
    const HalfF half;
    return to_float({hn::Mul(a.low, hn::PromoteTo(d, hn::LowerHalf(half, factor))),
                     hn::Mul(a.high, hn::PromoteTo(d, hn::UpperHalf(half, factor)))});
  }
  static HWY_INLINE VF to_float(Values a) {
    const HalfF half;
    return hn::Combine(F(), hn::DemoteTo(half, a.high), hn::DemoteTo(half, a.low));
  }
  static HWY_INLINE bool are_finite(Values a) {
    const auto most = hn::Set(D(), std::numeric_limits<double>::max());
    return hn::AllTrue(D(), hn::And(hn::Le(hn::Abs(a.low), most), hn::Le(hn::Abs(a.high), most)));
  }
};

/// Several vertices at once.
template <class T>
class VectorVertices {
 public:
  using Samples =
      std::conditional_t<std::is_same_v<Real<T>, float>, FloatSamples<T>, DoubleSamples<T>>;
  struct V3 {
    VF x, y, z;
  };

  VectorVertices(const KernelContext& context, const TileState& tile)
      : world_(context.world),
        isovalue_(context.isovalue),
        base_(reinterpret_cast<const T*>(tile.samples.data()) + TileLayout::kOrigin) {
    for (int axis = 0; axis < 3; ++axis) {
      origin_[axis] = static_cast<std::int32_t>(tile.shape.origin[axis]);
      last_[axis] = static_cast<std::int32_t>(context.extent[axis] - 1);
      at_border_ |= tile.shape.origin[axis] == 0 ||
                    tile.shape.origin[axis] + kTileSamples >= context.extent[axis];
    }
  }

  static std::size_t lanes() { return hn::Lanes(F()); }

  /// Writes lanes() vertices, or returns false where a sample is so large or a
  /// gradient so small that the definition takes another way.
  HWY_INLINE bool write(const std::uint32_t* edges, Vec3f* positions, Vec3f* normals) const {
    const F f;
    const I i;
    const VI code = hn::BitCast(i, hn::LoadU(hn::RebindToUnsigned<F>(), edges));
    const VI six = hn::Set(i, 63);
    const VI x = hn::And(code, six), y = hn::And(hn::ShiftRight<6>(code), six);
    const VI z = hn::And(hn::ShiftRight<12>(code), six), axis = hn::ShiftRight<18>(code);
    const auto along_x = hn::Eq(axis, hn::Zero(i)), along_y = hn::Eq(axis, hn::Set(i, 1));
    const auto along_z = hn::Eq(axis, hn::Set(i, 2));
    const VI step = hn::IfThenElse(
        along_x, hn::Set(i, 1),
        hn::IfThenElse(along_y, hn::Set(i, TileLayout::kRow), hn::Set(i, TileLayout::kPlane)));
    const VI offset = hn::Add(x, hn::Add(hn::Mul(y, hn::Set(i, TileLayout::kRow)),
                                         hn::Mul(z, hn::Set(i, TileLayout::kPlane))));
    const VI next = hn::Add(offset, step);
    const auto a = sample(offset), b = sample(next), d = Samples::subtract(b, a);
    if constexpr (std::is_floating_point_v<T>)
      if (!Samples::are_finite(d)) return false;
    const VF t =
        Samples::to_float(Samples::divide(Samples::subtract(Samples::set(isovalue_), a), d));
    const VI gx = hn::Add(x, hn::Set(i, origin_[0])), gy = hn::Add(y, hn::Set(i, origin_[1]));
    const VI gz = hn::Add(z, hn::Set(i, origin_[2]));
    if (normals) {
      const VI one = hn::Set(i, 1);
      const V3 ga = gradient(offset, gx, gy, gz);
      const V3 gb = gradient(next, hn::IfThenElse(along_x, hn::Add(gx, one), gx),
                             hn::IfThenElse(along_y, hn::Add(gy, one), gy),
                             hn::IfThenElse(along_z, hn::Add(gz, one), gz));
      const V3 n = turn(world_.normal,
                        {between(ga.x, gb.x, t), between(ga.y, gb.y, t), between(ga.z, gb.z, t)});
      const VF length2 = hn::Add(hn::Mul(n.x, n.x), hn::Add(hn::Mul(n.y, n.y), hn::Mul(n.z, n.z)));
      if (!hn::AllTrue(
              f, hn::And(hn::Ge(length2, hn::Set(f, 1e-30f)), hn::Le(length2, hn::Set(f, 1e30f)))))
        return false;
      const VF length = hn::Sqrt(length2);
      store({hn::Div(hn::Neg(n.x), length), hn::Div(hn::Neg(n.y), length),
             hn::Div(hn::Neg(n.z), length)},
            normals);
    }
    const auto place = [&](auto along, VI g) {
      const VF at = hn::ConvertTo(f, g);
      return hn::IfThenElse(hn::RebindMask(f, along), hn::Add(at, t), at);
    };
    const V3 p = turn(world_.m, {place(along_x, gx), place(along_y, gy), place(along_z, gz)});
    store({hn::Add(hn::Set(f, world_.origin[0]), p.x), hn::Add(hn::Set(f, world_.origin[1]), p.y),
           hn::Add(hn::Set(f, world_.origin[2]), p.z)},
          positions);
    return true;
  }

 private:
  HWY_INLINE auto sample(VI offset) const { return Samples::load(base_, offset); }

  HWY_INLINE VF difference(VI offset, int step, VI at, int axis) const {
    const F f;
    const I i;
    const VI s = hn::Set(i, step);
    if (!at_border_)
      return Samples::times(
          Samples::subtract(sample(hn::Add(offset, s)), sample(hn::Sub(offset, s))),
          hn::Set(f, 0.5f));
    const auto low = hn::Eq(at, hn::Zero(i)), high = hn::Eq(at, hn::Set(i, last_[axis]));
    const auto d = Samples::subtract(sample(hn::Add(offset, hn::IfThenZeroElse(high, s))),
                                     sample(hn::Sub(offset, hn::IfThenZeroElse(low, s))));
    return Samples::times(d, hn::IfThenElse(hn::RebindMask(f, hn::Or(low, high)), hn::Set(f, 1.0f),
                                            hn::Set(f, 0.5f)));
  }

  HWY_INLINE V3 gradient(VI offset, VI x, VI y, VI z) const {
    return {difference(offset, 1, x, 0), difference(offset, TileLayout::kRow, y, 1),
            difference(offset, TileLayout::kPlane, z, 2)};
  }

  static HWY_INLINE VF between(VF a, VF b, VF t) { return hn::Add(a, hn::Mul(t, hn::Sub(b, a))); }

  static HWY_INLINE V3 turn(const float (&m)[9], V3 v) {
    const F f;
    const auto row = [&](int r) {
      return hn::Add(hn::Mul(hn::Set(f, m[r]), v.x), hn::Add(hn::Mul(hn::Set(f, m[r + 1]), v.y),
                                                             hn::Mul(hn::Set(f, m[r + 2]), v.z)));
    };
    return {row(0), row(3), row(6)};
  }

  static HWY_INLINE void store(V3 v, Vec3f* to) {
    hn::StoreInterleaved3(v.x, v.y, v.z, F(), reinterpret_cast<float*>(to));
  }

  const WorldMap& world_;
  double isovalue_;
  const T* base_;
  std::int32_t origin_[3], last_[3];
  bool at_border_ = false;
};

#endif

template <class T>
void write_vertices(const KernelContext& context, const TileState& tile, Vec3f* positions,
                    Vec3f* normals) {
  const ScalarVertices<T> scalar{context, tile};
  const std::uint32_t* edges = tile.edges.data();
  const std::size_t n = tile.edges.size();
  std::size_t i = 0;
  const auto one = [&] {
    scalar.write(edges[i], positions + i, normals ? normals + i : nullptr);
    ++i;
  };
#if HWY_TARGET != HWY_SCALAR
  const VectorVertices<T> vectors(context, tile);
  for (const std::size_t lanes = vectors.lanes(); i + lanes <= n;) {
    if (vectors.write(edges + i, positions + i, normals ? normals + i : nullptr))
      i += lanes;
    else
      for (std::size_t lane = 0; lane < lanes; ++lane) one();
  }
#endif
  while (i < n) one();
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

// The classification of a tile's samples; included once for every SIMD target.

#if defined(ISOBRICK_TILE_CLASSIFY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_TILE_CLASSIFY_INL_H_
#undef ISOBRICK_TILE_CLASSIFY_INL_H_
#else
#define ISOBRICK_TILE_CLASSIFY_INL_H_
#endif

#include <hwy/highway.h>

#include <cstring>
#include <optional>

#include "core/threshold.h"
#include "surface/coincident_vertices.h"
#include "surface/tile_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
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
void classify_samples(const KernelContext& context, TileState& tile) {
  const Threshold<T> limit(context.isovalue);
  const T threshold = limit.value;
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
      // Only blocks of a cap are looked at where all is below.
      if (limit.none) tile.inside[row_index(y, z)] = 0;
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
void find_nan(const KernelContext& context, const TileState& tile, GoodCells& good) {
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

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

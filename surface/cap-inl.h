// The triangles of caps; included once for every SIMD target.

#if defined(ISOBRICK_CAP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_CAP_INL_H_
#undef ISOBRICK_CAP_INL_H_
#else
#define ISOBRICK_CAP_INL_H_
#endif

#include <bit>

#include "surface/cap.h"
#include "surface/coincident_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// The number of a cap's vertex on sample (x, y, z).
inline std::uint32_t cap_number(const TileCap& cap, int x, int y, int z) {
  const int row = row_index(y, z);
  const std::uint64_t before = cap.used[row] & ((std::uint64_t{1} << x) - 1);
  return cap.vertices[cap.first[row] + static_cast<std::uint32_t>(std::popcount(before))].number;
}

/// Writes the triangles of the tile's cap. They face away from the cells, so only left-handed axes
/// turn them round.
inline void write_cap_triangles(const KernelContext& context, const TileState& tile,
                                Triangle* out) {
  const bool mirrored = context.world.mirrored != (context.inside == Inside::below);
  const std::size_t second = mirrored ? 2 : 1, third = 3 - second;
  for (const CapFace face : tile.cap->faces) {
    const int x = static_cast<int>(face & 31), y = static_cast<int>(face >> 5 & 31),
              z = static_cast<int>(face >> 10 & 31);
    const auto& of_face = case_rule::kFaces[face >> 15 & 7];
    const CapPolygon& polygon = kCapPolygons[face >> 18];
    const auto number = [&](std::uint8_t corner) {
      const int c = of_face[corner & 3];
      if (corner < 4) return cap_number(*tile.cap, x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
      return edge_number(tile, x, y, z, case_rule::edge_between(c, of_face[(corner + 1) & 3]));
    };
    const std::uint8_t* corners = polygon.corners.data();
    for (int n = polygon.triangles; n > 0; --n, corners += 3)
      *out++ = {number(corners[0]), number(corners[second]), number(corners[third])};
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

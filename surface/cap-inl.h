// The triangles of caps; included once for every SIMD target.

#if defined(ISOBRICK_CAP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_CAP_INL_H_
#undef ISOBRICK_CAP_INL_H_
#else
#define ISOBRICK_CAP_INL_H_
#endif

#include "surface/cap.h"
#include "surface/coincident_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// Writes the triangles of the tile's cap. They face away from the cells, so only left-handed axes
/// turn them round.
inline void write_cap_triangles(const KernelContext& context, const TileState& tile,
                                Triangle* out) {
  const bool mirrored = context.world.mirrored != (context.inside == Inside::below);
  for (const CapFace face : tile.cap->faces) {
    const int x = static_cast<int>(face & 31), y = static_cast<int>(face >> 5 & 31),
              z = static_cast<int>(face >> 10 & 31);
    const std::uint32_t at =
        tile.coincident ? coincident::corner_bits(tile.coincident->at, x, y, z) : 0;
    const auto number = [&](int vertex) {
      return vertex < 8 ? sample_number(*tile.on_samples, x, y, z, vertex)
                        : edge_number(tile, x, y, z, vertex - 8);
    };
    for_each_cap_triangle(face >> 15 & 7, face >> 18, at, [&](int a, int b, int c) {
      *out++ = mirrored ? Triangle{number(a), number(c), number(b)}
                        : Triangle{number(a), number(b), number(c)};
    });
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

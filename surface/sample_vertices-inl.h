// Vertices on samples; included once for every SIMD target.

#if defined(ISOBRICK_SAMPLE_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_SAMPLE_VERTICES_INL_H_
#undef ISOBRICK_SAMPLE_VERTICES_INL_H_
#else
#define ISOBRICK_SAMPLE_VERTICES_INL_H_
#endif

#include <bit>

#include "surface/cap.h"
#include "surface/tile_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// Writes the tile's own vertices on samples. Where the surface meets a sample, the normal is that
/// of its gradient, elsewhere that of the border.
template <class T>
void write_sample_vertices(const KernelContext& context, const TileState& tile, Vec3f* positions,
                           Vec3f* normals) {
  const ScalarVertices<T> scalar{context, tile};
  AxisNormals of_border{};
  if (normals && tile.cap) of_border = axis_normals(context.world, context.inside);
  for (const SampleVertex& vertex : tile.on_samples->vertices) {
    if (vertex.owner != SampleVertex::kOwn) continue;
    scalar.write_sample(vertex.place, positions++, vertex.of_surface ? normals : nullptr);
    if (!normals) continue;
    if (!vertex.of_surface)
      *normals = border_normal(
          of_border, vertex.place & 63, vertex.place >> 6 & 63, vertex.place >> 12 & 63,
          [&](int x, int y, int z) { return exists(tile.cap->cells, x, y, z); });
    ++normals;
  }
}

/// The number of the vertex on corner `corner` of the cell at (x, y, z), a used sample.
inline std::uint32_t sample_number(const SampleVertices& samples, int x, int y, int z, int corner) {
  const int row = row_index(y + (corner >> 1 & 1), z + (corner >> 2));
  const std::uint64_t before = (std::uint64_t{1} << (x + (corner & 1))) - 1;
  return samples
      .vertices[samples.first[row] +
                static_cast<std::uint32_t>(std::popcount(samples.used[row] & before))]
      .number;
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif

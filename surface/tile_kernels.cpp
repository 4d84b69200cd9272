#include "surface/tile_kernels.h"

// Highway compiles what lies in HWY_NAMESPACE once for every target below.
#define HWY_WANT_AVX3_DL  // vpopcntd
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "surface/tile_kernels.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
//
#include <hwy/highway.h>

#include "core/simd_targets.h"
#include "surface/cap-inl.h"
#include "surface/case_tables.h"
#include "surface/coincident_vertices-inl.h"
#include "surface/patched_cells-inl.h"
#include "surface/sample_vertices-inl.h"
#include "surface/tile_count-inl.h"
#include "surface/tile_triangles-inl.h"
#include "surface/tile_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

void Count(ScalarType type, const KernelContext& context, TileState& tile) {
  visit_scalar(type, [&](auto tag) { count_tile<typename decltype(tag)::type>(context, tile); });
}

void Write(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
           Vec3f* normals, Triangle* triangles) {
  list_edges(tile);
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    write_vertices<T>(context, tile, positions, normals);
    const auto write_from = [&](std::uint32_t first, const auto& write) {
      write(positions + first, normals ? normals + first : nullptr);
    };
    if (tile.inner_vertices > 0)
      write_from(tile.edge_vertices, [&](Vec3f* to, Vec3f* normals_to) {
        write_inner_vertices<T>(context, tile, to, normals_to);
      });
    if (tile.on_samples && tile.on_samples->own > 0)
      write_from(tile.edge_vertices + tile.inner_vertices, [&](Vec3f* to, Vec3f* normals_to) {
        write_sample_vertices<T>(context, tile, to, normals_to);
      });
  });
  const CaseTables& tables = context.world.mirrored ? kMirroredCaseTables : kCaseTables;
  Triangle* const cap = triangles + (tile.triangles - tile.cap_triangles());
  Triangle* const patched = cap - tile.patched_triangles;
  write_triangles(tables, tile, triangles);
  if (tile.coincident) {
    write_kept_triangles(tables, tile, patched - tile.coincident->triangles);
    write_kept_patched_triangles(context.world.mirrored, tile, patched);
  } else if (tile.patched.size() > 0) {
    write_patched_triangles(context.world.mirrored, tile, patched);
  }
  if (tile.cap_triangles() > 0) write_cap_triangles(context, tile, cap);
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isobrick::inline v0 {

void count_tile(ScalarType type, const KernelContext& context, TileState& tile) {
  const auto best = ISOBRICK_BEST_OF(Count);
  best(type, context, tile);
}

void write_tile(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
                Vec3f* normals, Triangle* triangles) {
  const auto best = ISOBRICK_BEST_OF(Write);
  best(type, context, tile, positions, normals, triangles);
}

}  // namespace isobrick
#endif  // HWY_ONCE

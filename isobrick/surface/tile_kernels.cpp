#include "isobrick/surface/tile_kernels.h"

// Highway compiles what lies in HWY_NAMESPACE once for every target below.
#define HWY_WANT_AVX3_DL  // vpopcntd
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "isobrick/surface/tile_kernels.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
//
#include <hwy/highway.h>

#include "isobrick/surface/case_tables.h"
#include "isobrick/surface/tile_scan-inl.h"
#include "isobrick/surface/tile_ties-inl.h"
#include "isobrick/surface/tile_triangles-inl.h"
#include "isobrick/surface/tile_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick {
namespace HWY_NAMESPACE {

void Scan(ScalarType type, const KernelContext& context, TileState& tile) {
  visit_scalar(type, [&](auto tag) { scan_samples<typename decltype(tag)::type>(context, tile); });
}

void Emit(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
          Vec3f* normals, Triangle* triangles) {
  list_edges(tile);
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    emit_vertices<T>(context, tile, positions, normals);
    if (tile.ties)
      emit_tie_vertices<T>(context, tile, positions + tile.edge_vertices,
                           normals ? normals + tile.edge_vertices : nullptr);
  });
  const CaseTables& tables = context.world.mirrored ? kMirroredCaseTables : kCaseTables;
  if (tile.ties && tile.ties->matter())
    emit_kept_triangles(tables, tile, triangles);
  else
    emit_triangles(tables, tile, triangles);
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isobrick {

HWY_EXPORT(Scan);
HWY_EXPORT(Emit);

void scan_tile(ScalarType type, const KernelContext& context, TileState& tile) {
  HWY_DYNAMIC_DISPATCH(Scan)(type, context, tile);
}

void emit_tile(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
               Vec3f* normals, Triangle* triangles) {
  HWY_DYNAMIC_DISPATCH(Emit)(type, context, tile, positions, normals, triangles);
}

}  // namespace isobrick
#endif  // HWY_ONCE

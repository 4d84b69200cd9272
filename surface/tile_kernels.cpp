#include "surface/tile_kernels.h"

// Highway compiles what lies in HWY_NAMESPACE once for every target below.
#define HWY_WANT_AVX3_DL  // vpopcntd
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "surface/tile_kernels.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
//
#include <hwy/highway.h>

#include "surface/case_tables.h"
#include "surface/coincident_vertices-inl.h"
#include "surface/tile_count-inl.h"
#include "surface/tile_triangles-inl.h"
#include "surface/tile_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick {
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
    if (tile.coincident)
      write_coincident_vertices<T>(context, tile, positions + tile.edge_vertices,
                                   normals ? normals + tile.edge_vertices : nullptr);
  });
  const CaseTables& tables = context.world.mirrored ? kMirroredCaseTables : kCaseTables;
  if (tile.coincident && tile.coincident->matter())
    write_kept_triangles(tables, tile, triangles);
  else
    write_triangles(tables, tile, triangles);
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isobrick {

namespace {

struct Kernels {
  decltype(&HWY_STATIC_DISPATCH(Count)) count = nullptr;
  decltype(&HWY_STATIC_DISPATCH(Write)) write = nullptr;
};

// Empty for a target that was not compiled.
#define ISOBRICK_KERNELS(TARGET) \
  Kernels { HWY_CHOOSE_##TARGET(Count), HWY_CHOOSE_##TARGET(Write) }

/// Those that this processor runs best. Highway's own dispatch would do the
/// same, but it links libhwy, which times its clock for 5 ms whenever a program
/// starts.
Kernels best_kernels() {
  Kernels best;
#if HWY_ARCH_X86
  __builtin_cpu_init();
  const bool sse4 = __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("sse4.2") &&
                    __builtin_cpu_supports("aes") && __builtin_cpu_supports("pclmul");
  const bool avx2 = sse4 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                    __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const bool avx3 = avx2 && __builtin_cpu_supports("avx512f") &&
                    __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
                    __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd");
  const bool avx3_dl =
      avx3 && __builtin_cpu_supports("avx512vnni") && __builtin_cpu_supports("vpclmulqdq") &&
      __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512vbmi2") &&
      __builtin_cpu_supports("avx512bitalg") && __builtin_cpu_supports("avx512vpopcntdq");
  if (avx3_dl) best = ISOBRICK_KERNELS(AVX3_DL);
  if (avx3 && !best.count) best = ISOBRICK_KERNELS(AVX3);
  if (avx2 && !best.count) best = ISOBRICK_KERNELS(AVX2);
  if (sse4 && !best.count) best = ISOBRICK_KERNELS(SSE4);
#endif
  // What the compiler's options allow: all that other processors need.
  if (!best.count) best = {&HWY_STATIC_DISPATCH(Count), &HWY_STATIC_DISPATCH(Write)};
  return best;
}

const Kernels& kernels() {
  static const Kernels best = best_kernels();
  return best;
}

}  // namespace

void count_tile(ScalarType type, const KernelContext& context, TileState& tile) {
  kernels().count(type, context, tile);
}

void write_tile(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
                Vec3f* normals, Triangle* triangles) {
  kernels().write(type, context, tile, positions, normals, triangles);
}

}  // namespace isobrick
#endif  // HWY_ONCE

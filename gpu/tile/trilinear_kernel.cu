#include <algorithm>
#include <type_traits>

#include "gpu/tile/tile_kernel.h"
#include "gpu/tile/tile_launcher.cuh"

namespace isobrick::inline v0::gpu {

LaunchShape trilinear_shape(ScalarType type, bool normals, bool may_have_nan) {
  LaunchShape shape = visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    const auto of = [&](auto nan) {
      constexpr bool kNan = decltype(nan)::value;
      return normals ? Launcher<384, T, true, kNan, TileExtra::trilinear>::shape()
                     : Launcher<384, T, false, kNan, TileExtra::trilinear>::shape();
    };
    if constexpr (std::is_floating_point_v<T>)
      if (may_have_nan) return of(std::true_type());
    return of(std::false_type());
  });
  shape.blocks = std::min(shape.blocks, kMaxTrilinearBlocks);
  return shape;
}

}  // namespace isobrick::gpu

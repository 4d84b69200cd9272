#include <algorithm>

#include "gpu/tile/tile_kernel.h"
#include "gpu/tile/tile_launcher.cuh"

namespace isobrick::inline v0::gpu {

LaunchShape trilinear_on_samples_shape(ScalarType type, bool normals) {
  LaunchShape shape = visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return normals ? Launcher<384, T, true, true, TileExtra::both>::shape()
                   : Launcher<384, T, false, true, TileExtra::both>::shape();
  });
  shape.blocks = std::min({shape.blocks, kMaxSampleBlocks, kMaxTrilinearBlocks});
  return shape;
}

}  // namespace isobrick::gpu

#include "gpu/stream/unpack_kernel.h"

#include "gpu/memory/cuda_check.h"
#include "gpu/stream/unpack_tiles.cuh"

namespace isobrick::inline v0::gpu {

void launch_unpack(ScalarType type, const UnpackParams& params, cudaStream_t stream) {
  visit_scalar(type, [&](auto tag) {
    unpack_tiles<typename decltype(tag)::type><<<params.count, kUnpackThreads, 0, stream>>>(params);
  });
  check_launch("unpack_tiles");
}

}  // namespace isobrick::gpu

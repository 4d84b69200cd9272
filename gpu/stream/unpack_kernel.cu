#include "isobrick/gpu/unpack_kernel.h"

#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/unpack_tiles.cuh"

namespace isobrick::gpu {

void launch_unpack(ScalarType type, const UnpackParams& params, cudaStream_t stream) {
  visit_device_scalar(type, [&](auto tag) {
    unpack_tiles<typename decltype(tag)::type><<<params.count, kUnpackThreads, 0, stream>>>(params);
  });
  check_launch("unpack_tiles");
}

}  // namespace isobrick::gpu

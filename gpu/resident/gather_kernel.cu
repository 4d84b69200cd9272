#include "gpu/resident/gather_kernel.h"

#include "gpu/memory/cuda_check.h"
#include "gpu/resident/gather_tiles.cuh"

namespace isobrick::inline v0::gpu {

void launch_gather(ScalarType type, const GatherParams& params, cudaStream_t stream) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    if (has_pieces<T>(params))
      gather_tiles<T, SamplePiece<T>><<<params.count, kGatherThreads, 0, stream>>>(params);
    else
      gather_tiles<T, T><<<params.count, kGatherThreads, 0, stream>>>(params);
  });
  check_launch("gather_tiles");
}

}  // namespace isobrick::gpu

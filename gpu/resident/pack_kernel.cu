#include "gpu/resident/pack_kernel.h"

#include "gpu/memory/cuda_check.h"
#include "gpu/resident/pack_tiles.cuh"

namespace isobrick::inline v0::gpu {
namespace {

template <class T>
void launch_pack_of(const PackParams& params, cudaStream_t stream) {
  switch (pack_order(params, sizeof(T))) {
    case PackOrder::vectors:
      pack_tiles<T, PackOrder::vectors><<<params.count, kPackThreads, 0, stream>>>(params);
      break;
    case PackOrder::along_x:
      pack_tiles<T, PackOrder::along_x><<<params.count, kPackThreads, 0, stream>>>(params);
      break;
    case PackOrder::along_y:
      pack_tiles<T, PackOrder::along_y><<<params.count, kPackThreads, 0, stream>>>(params);
      break;
    case PackOrder::along_z:
      pack_tiles<T, PackOrder::along_z><<<params.count, kPackThreads, 0, stream>>>(params);
      break;
  }
  check_launch("pack_tiles");
  join_part_ranges<T>
      <<<(params.count + kPackThreads - 1) / kPackThreads, kPackThreads, 0, stream>>>(params);
  check_launch("join_part_ranges");
}

}  // namespace

void launch_pack(ScalarType type, const PackParams& params, cudaStream_t stream) {
  visit_scalar(type,
               [&](auto tag) { launch_pack_of<typename decltype(tag)::type>(params, stream); });
}

}  // namespace isobrick::gpu

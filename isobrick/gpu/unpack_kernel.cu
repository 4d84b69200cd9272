#include "isobrick/gpu/unpack_kernel.h"

#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/streamed_pages.cuh"

namespace isobrick::gpu {
namespace {

constexpr int kThreads = 512;

/// The blocks of 16³ cells, as bits of TileWork, that lie within `reach` of a place
/// along an axis; `lower` are those of the lower half.
__device__ unsigned blocks_near(int at, int reach, unsigned lower) {
  return (at <= 16 + reach ? lower : 0u) | (at >= 16 - reach ? ~lower & 0xffu : 0u);
}

template <class T>
__global__ void __launch_bounds__(kThreads) unpack_tiles(const __grid_constant__ UnpackParams p) {
  __shared__ T* pages[27];
  const TileItem item = p.items[blockIdx.x];
  const unsigned active = p.links[blockIdx.x].active_blocks;
  const T* from =
      reinterpret_cast<const T*>(static_cast<const char*>(p.blocks) + blockIdx.x * p.block_bytes);
  if (threadIdx.x < 27)
    pages[threadIdx.x] =
        static_cast<T*>(p.pages) + streamed_page(blockIdx.x, static_cast<int>(threadIdx.x));
  __syncthreads();
  const int reach = p.reach, edge = 33 + 2 * reach;
  const int tile[3] = {item.x, item.y, item.z};
  int shared = 0;  // place of the sample that all blocks share
#pragma unroll
  for (int axis = 2; axis >= 0; --axis)
    shared = shared * edge + reach + ::min(16, p.extent[axis] - 1 - 32 * tile[axis]);
  const T side = from[shared];
  for (int i = static_cast<int>(threadIdx.x); i < edge * edge * edge; i += kThreads) {
    const int x = i % edge - reach, y = i / edge % edge - reach, z = i / (edge * edge) - reach;
    const auto outside = [](int v) { return v < 0 || v > 32; };
    if (outside(x) + outside(y) + outside(z) > 1) continue;
    const unsigned near = active & blocks_near(x, reach, 0x55u) & blocks_near(y, reach, 0x33u) &
                          blocks_near(z, reach, 0x0fu);
    pages[13 + (x >> 5) + 3 * (y >> 5) + 9 * (z >> 5)][(x & 31) | (y & 31) << 5 | (z & 31) << 10] =
        near ? from[i] : side;
  }
}

}  // namespace

void launch_unpack(ScalarType type, const UnpackParams& params, cudaStream_t stream) {
  visit_device_scalar(type, [&](auto tag) {
    unpack_tiles<typename decltype(tag)::type><<<params.count, kThreads, 0, stream>>>(params);
  });
  check_launch("unpack_tiles");
}

}  // namespace isobrick::gpu

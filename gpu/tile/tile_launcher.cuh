#pragma once

#include "core/threshold.h"
#include "gpu/memory/cuda_check.h"
#include "gpu/tile/extract_tiles.cuh"
#include "gpu/tile/tile_kernel.h"

namespace isobrick::inline v0::gpu {

inline int device_attribute(cudaDeviceAttr attribute) {
  int device = 0, value = 0;
  check(cudaGetDevice(&device));
  check(cudaDeviceGetAttribute(&value, attribute, device));
  return value;
}

/// How many blocks of a kernel fill the current device, and how it is launched.
template <int N, class T, bool Normals, bool Nan = false, TileExtra Extra = TileExtra::none>
struct Launcher {
  static constexpr auto kKernel = extract_tiles<N, T, Normals, Nan, Extra>;

  static LaunchShape shape() {
    const bool before_ampere = device_attribute(cudaDevAttrComputeCapabilityMajor) < 8;
    LaunchShape shape{.threads = N, .launch = launch};
    shape.listed = before_ampere ? kListedBeforeAmpere : BlockConfig<N>::kMaxListed;
    shape.shared_bytes = before_ampere ? kSharedBytes<kListedBeforeAmpere, Nan>
                                       : kSharedBytes<BlockConfig<N>::kMaxListed, Nan>;
    shape.blocks = blocks(shape.shared_bytes);
    return shape;
  }

 private:
  static int blocks(std::size_t shared_bytes) {
    if (static_cast<std::size_t>(device_attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin)) <
        shared_bytes)
      return 0;
    check(cudaFuncSetAttribute(kKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                               static_cast<int>(shared_bytes)));
    int each = 0;
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kKernel, N, shared_bytes));
    return each * device_attribute(cudaDevAttrMultiProcessorCount);
  }
  static void launch(const LaunchShape& shape, const TileParams& params, const CaseTable* cases,
                     cudaStream_t stream) {
    const T threshold = Threshold<T>(params.isovalue).value;
    kKernel<<<static_cast<unsigned>(shape.blocks), N, shape.shared_bytes, stream>>>(
        params, threshold, cases);
    check_launch("extract_tiles");
  }
};

}  // namespace isobrick::gpu

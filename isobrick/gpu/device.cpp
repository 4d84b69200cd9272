#include "isobrick/gpu/device.h"

#include <cuda_runtime_api.h>

#include "isobrick/gpu/cuda_check.h"

namespace isobrick::gpu {

int device_count() noexcept {
  int count = 0;
  return cudaGetDeviceCount(&count) == cudaSuccess ? count : 0;
}

DeviceInfo open_device(int device) {
  check(cudaSetDevice(device));
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, device));
  std::size_t free = 0, total = 0;
  check(cudaMemGetInfo(&free, &total));
  return {properties.name, free, total};
}

}  // namespace isobrick::gpu

#include <isobrick/device.h>

#include <cuda_runtime_api.h>

#include <cstring>

#include "gpu/memory/cuda_check.h"
#include "gpu/memory/device_scope.h"

namespace isobrick::inline v0::gpu {

int device_count() noexcept {
  int count = 0;
  return cudaGetDeviceCount(&count) == cudaSuccess ? count : 0;
}

bool reads_host_memory(int device) {
  int same = 0;
  check(cudaDeviceGetAttribute(&same, cudaDevAttrCanUseHostPointerForRegisteredMem, device));
  return same != 0;
}

std::array<std::uint8_t, 16> device_id(int device) {
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, device));
  std::array<std::uint8_t, 16> id{};
  static_assert(sizeof properties.uuid.bytes == sizeof id);
  std::memcpy(id.data(), properties.uuid.bytes, sizeof id);
  return id;
}

DeviceInfo open_device(int device) {
  check(cudaSetDevice(device));
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, device));
  std::size_t free = 0, total = 0;
  check(cudaMemGetInfo(&free, &total));
  return {properties.name, free, total};
}

DeviceScope::DeviceScope(int device) noexcept {
  (void)cudaGetDevice(&before_);
  if (device != before_) (void)cudaSetDevice(device);
}

DeviceScope::~DeviceScope() { (void)cudaSetDevice(before_); }

}  // namespace isobrick::gpu

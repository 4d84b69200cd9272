#pragma once

#include <cuda_runtime_api.h>

namespace isobrick::inline v0::gpu {

/// Makes a device the calling thread's, until the scope ends.
class DeviceScope {
 public:
  explicit DeviceScope(int device) noexcept {
    (void)cudaGetDevice(&before_);
    if (device != before_) (void)cudaSetDevice(device);
  }
  DeviceScope(const DeviceScope&) = delete;
  DeviceScope& operator=(const DeviceScope&) = delete;
  ~DeviceScope() { (void)cudaSetDevice(before_); }

 private:
  int before_ = 0;
};

}  // namespace isobrick::gpu

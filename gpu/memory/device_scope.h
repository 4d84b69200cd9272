#pragma once

namespace isobrick::inline v0::gpu {

/// Makes a device the calling thread's, until the scope ends.
class DeviceScope {
 public:
  explicit DeviceScope(int device) noexcept;
  DeviceScope(const DeviceScope&) = delete;
  DeviceScope& operator=(const DeviceScope&) = delete;
  ~DeviceScope();

 private:
  int before_ = 0;
};

}  // namespace isobrick::gpu

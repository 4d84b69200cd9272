#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <isobrick/api.h>
#include <isobrick/error.h>

namespace isobrick::inline v0::gpu {

/// CUDA devices that this program can use; 0 also where there is no driver.
ISOBRICK_API int device_count() noexcept;

/// Whether there is one.
inline bool device_available() noexcept { return device_count() > 0; }

/// A CUDA device.
struct DeviceInfo {
  std::string name;               ///< as the driver has it
  std::uint64_t free_bytes = 0;   ///< device memory that is free now
  std::uint64_t total_bytes = 0;  ///< device memory
};

/// The device has less memory left than was requested.
class ISOBRICK_API OutOfDeviceMemory : public Error {
 public:
  using Error::Error;
};

/// Whether kernels read page-locked host memory under the address that the host knows.
ISOBRICK_API bool reads_host_memory(int device);

/// 16 bytes by which drivers of all kinds identify a device. Throws Error for a device that
/// does not exist.
ISOBRICK_API std::array<std::uint8_t, 16> device_id(int device);

/// Sets the device up for this process (some tenths of a second the first time) and
/// makes it the calling thread's. Throws Error when that fails.
ISOBRICK_API DeviceInfo open_device(int device);

}  // namespace isobrick::gpu

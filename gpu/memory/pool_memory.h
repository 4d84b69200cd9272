#pragma once

#include <memory>

#include <isobrick/device_array.h>

namespace isobrick::inline v0::gpu {

/// A pool of the current device's memory that all share who hold it, and that keeps what is given
/// back: the device's own pool returns it to the driver whenever a stream is waited for, which
/// takes milliseconds a gigabyte.
std::shared_ptr<DeviceMemory> pool_memory();

}  // namespace isobrick::gpu

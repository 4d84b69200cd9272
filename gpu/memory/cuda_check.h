#pragma once

#include <cuda_runtime_api.h>

#include <source_location>

namespace isobrick::inline v0::gpu {

/// Throws Error with the name of the CUDA error and where it was noticed, OutOfDeviceMemory when
/// it is that.
void check(cudaError_t result, const std::source_location& where = std::source_location::current());

/// Makes the device the calling thread's; returns it.
int make_current(int device);

/// After a launch: throws Error naming the kernel when it could not be launched.
void check_launch(const char* kernel,
                  const std::source_location& where = std::source_location::current());

}  // namespace isobrick::gpu

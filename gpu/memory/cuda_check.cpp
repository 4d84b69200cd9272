#include "gpu/memory/cuda_check.h"

#include <fmt/format.h>

#include <isobrick/device.h>

namespace isobrick::inline v0::gpu {
namespace {

void fail(cudaError_t result, const char* what, const std::source_location& where) {
  const std::string message =
      fmt::format("CUDA: {}: {} ({}), at {}:{}", what, cudaGetErrorString(result),
                  cudaGetErrorName(result), where.file_name(), where.line());
  if (result != cudaErrorMemoryAllocation) throw Error(message);
  (void)cudaGetLastError();  // or the next launch would report it
  throw OutOfDeviceMemory(message);
}

}  // namespace

void check(cudaError_t result, const std::source_location& where) {
  if (result != cudaSuccess) fail(result, "call failed", where);
}

int make_current(int device) {
  check(cudaSetDevice(device));
  return device;
}

void check_launch(const char* kernel, const std::source_location& where) {
  const cudaError_t result = cudaGetLastError();
  if (result != cudaSuccess) fail(result, kernel, where);
}

}  // namespace isobrick::gpu

#include <algorithm>
#include <atomic>
#include <cuda/atomic>

#include "isobrick/gpu/cuda_check.h"
#include "tests/gpu/busy_device.h"

namespace isobrick::testing {
namespace {

using HostWord = cuda::atomic_ref<unsigned, cuda::thread_scope_system>;

constexpr unsigned long long kMostNanoseconds = 3'000'000'000;

__device__ unsigned long long now() {
  unsigned long long time;
  asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(time));
  return time;
}

__global__ void stay_until_told(unsigned* words) {
  HostWord(words[0]).fetch_add(1);
  const unsigned long long start = now();
  while (HostWord(words[1]).load() == 0 && now() - start < kMostNanoseconds) {
  }
  HostWord(words[2]).store(1);
}

}  // namespace

BusyDevice::BusyDevice(int left) {
  int processors = 0, shared = 0;
  gpu::check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0));
  gpu::check(cudaDeviceGetAttribute(&shared, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0));
  gpu::check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
  gpu::check(
      cudaHostAlloc(reinterpret_cast<void**>(&words_), 3 * sizeof *words_, cudaHostAllocMapped));
  words_[0] = words_[1] = words_[2] = 0;
  // Each takes the shared memory of one.
  gpu::check(
      cudaFuncSetAttribute(stay_until_told, cudaFuncAttributeMaxDynamicSharedMemorySize, shared));
  const auto blocks = static_cast<unsigned>(std::max(processors - left, 1));
  stay_until_told<<<blocks, 1, static_cast<std::size_t>(shared), stream_>>>(words_);
  gpu::check_launch("stay_until_told");
  while (std::atomic_ref(words_[0]).load() < blocks) gpu::check(cudaPeekAtLastError());
}

bool BusyDevice::has_ended() const { return std::atomic_ref(words_[2]).load() != 0; }

BusyDevice::~BusyDevice() {
  std::atomic_ref(words_[1]).store(1);
  (void)cudaStreamSynchronize(stream_);
  (void)cudaStreamDestroy(stream_);
  (void)cudaFreeHost(words_);
}

}  // namespace isobrick::testing

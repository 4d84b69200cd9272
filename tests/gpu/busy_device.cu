#include <algorithm>
#include <atomic>
#include <cuda/atomic>

#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/ptx.cuh"
#include "tests/gpu/busy_device.h"

namespace isobrick::testing {
namespace {

using HostWord = cuda::atomic_ref<unsigned, cuda::thread_scope_system>;

constexpr std::uint64_t kMostNanoseconds = 3'000'000'000;

/// `words`: to end, has ended, and for each block whether it has begun.
__global__ void stay_until_told(unsigned* words) {
  HostWord(words[2 + blockIdx.x]).store(1);
  const std::uint64_t start = gpu::global_nanoseconds();
  while (HostWord(words[0]).load() == 0 && gpu::global_nanoseconds() - start < kMostNanoseconds) {
  }
  HostWord(words[1]).store(1);
}

}  // namespace

BusyDevice::BusyDevice(int left) {
  int processors = 0, shared = 0;
  gpu::check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0));
  gpu::check(cudaDeviceGetAttribute(&shared, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0));
  const auto blocks = static_cast<unsigned>(std::max(processors - left, 1));
  const std::size_t bytes = (2 + blocks) * sizeof *words_;
  gpu::check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
  gpu::check(cudaHostAlloc(reinterpret_cast<void**>(&words_), bytes, cudaHostAllocMapped));
  std::fill_n(words_, 2 + blocks, 0u);
  // Each takes the shared memory of one.
  gpu::check(
      cudaFuncSetAttribute(stay_until_told, cudaFuncAttributeMaxDynamicSharedMemorySize, shared));
  stay_until_told<<<blocks, 1, static_cast<std::size_t>(shared), stream_>>>(words_);
  gpu::check_launch("stay_until_told");
  const auto all_begun = [&] {
    return std::all_of(words_ + 2, words_ + 2 + blocks,
                       [](unsigned& word) { return std::atomic_ref(word).load() != 0; });
  };
  while (!all_begun() && !has_ended()) gpu::check(cudaPeekAtLastError());
}

bool BusyDevice::has_ended() const { return std::atomic_ref(words_[1]).load() != 0; }

BusyDevice::~BusyDevice() {
  std::atomic_ref(words_[0]).store(1);
  (void)cudaStreamSynchronize(stream_);
  (void)cudaStreamDestroy(stream_);
  (void)cudaFreeHost(words_);
}

}  // namespace isobrick::testing

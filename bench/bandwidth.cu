#include <algorithm>
#include <limits>

#include "bench/bandwidth.h"
#include "gpu/memory/device_buffer.h"

namespace isobrick::bench {
namespace {

constexpr int kThreads = 512;

__global__ void read_all(const uint4* from, std::size_t n, unsigned* sink) {
  unsigned sum = 0;
  const std::size_t step = std::size_t{gridDim.x} * kThreads;
#pragma unroll 4
  for (std::size_t i = std::size_t{blockIdx.x} * kThreads + threadIdx.x; i < n; i += step) {
    const uint4 v = from[i];
    sum += v.x ^ v.y ^ v.z ^ v.w;
  }
  if (sum == 0x12345678u) *sink = sum;
}

__global__ void write_all(uint4* to, std::size_t n, unsigned value) {
  const std::size_t step = std::size_t{gridDim.x} * kThreads;
  for (std::size_t i = std::size_t{blockIdx.x} * kThreads + threadIdx.x; i < n; i += step)
    to[i] = {value, value, value, value};
}

}  // namespace

Bandwidth measure_bandwidth(std::size_t bytes) {
  const gpu::Stream stream;
  int device = 0, multiprocessors = 0;
  gpu::check(cudaGetDevice(&device));
  gpu::check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device));
  const gpu::DeviceBuffer<uint4> buffer(bytes / sizeof(uint4), stream);
  const gpu::DeviceBuffer<unsigned> sink(1, stream);
  gpu::Event start, end;
  float read = std::numeric_limits<float>::max(), write = read;
  for (int i = 0; i < 10; ++i) {
    start.record(stream);
    write_all<<<multiprocessors * 16, kThreads, 0, stream.get()>>>(buffer.data(), buffer.size(),
                                                                   static_cast<unsigned>(i));
    end.record(stream);
    end.wait();
    write = std::min(write, end.since(start));
    start.record(stream);
    read_all<<<multiprocessors * 8, kThreads, 0, stream.get()>>>(buffer.data(), buffer.size(),
                                                                 sink.data());
    end.record(stream);
    end.wait();
    read = std::min(read, end.since(start));
  }
  const double moved = static_cast<double>(buffer.bytes());
  return {moved / (read * 1e-3), moved / (write * 1e-3)};
}

}  // namespace isobrick::bench

#include "gpu/memory/copy_kernel.h"
#include "gpu/memory/cuda_check.h"

namespace isobrick::inline v0::gpu {
namespace {

constexpr unsigned kThreads = 256, kBlocksOfChunk = 8;

static_assert(sizeof(uint4) == CopyChunks::kAlign);

/// A row of blocks a chunk. Each thread has four words on their way at a time, for the other end
/// of the bus is far away.
__global__ void __launch_bounds__(kThreads) copy_chunks(CopyChunks chunks) {
  const std::size_t words = chunks.units[blockIdx.y];
  const uint4* from = static_cast<const uint4*>(chunks.from[blockIdx.y]);
  uint4* to = static_cast<uint4*>(chunks.to[blockIdx.y]);
  constexpr std::size_t step = kBlocksOfChunk * kThreads;
  std::size_t i = blockIdx.x * kThreads + threadIdx.x;
  for (; i + 3 * step < words; i += 4 * step) {
    const uint4 a = __ldcs(from + i), b = __ldcs(from + i + step), c = __ldcs(from + i + 2 * step),
                d = __ldcs(from + i + 3 * step);
    to[i] = a;
    to[i + step] = b;
    to[i + 2 * step] = c;
    to[i + 3 * step] = d;
  }
  for (; i < words; i += step) to[i] = __ldcs(from + i);
}

__global__ void report_copies(CopyReport* report, unsigned long long number,
                              const unsigned long long* failed) {
  if (failed) report->failed = *failed;
  __threadfence_system();
  *static_cast<volatile unsigned long long*>(&report->completed) = number;
}

}  // namespace

void launch_copy(const CopyChunks& chunks, cudaStream_t stream) {
  if (chunks.count == 0) return;
  copy_chunks<<<dim3(kBlocksOfChunk, chunks.count), kThreads, 0, stream>>>(chunks);
  check_launch("copy_chunks");
}

void launch_report(CopyReport* report, unsigned long long number, const unsigned long long* failed,
                   cudaStream_t stream) {
  report_copies<<<1, 1, 0, stream>>>(report, number, failed);
  check_launch("report_copies");
}

}  // namespace isobrick::gpu

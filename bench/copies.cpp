#include "bench/copies.h"

#include <algorithm>

#include "gpu/memory/device_buffer.h"
#include "gpu/memory/pinned_buffer.h"

namespace isobrick::bench {

double copy_seconds(std::uint64_t bytes, std::uint64_t piece, bool to_device) {
  if (bytes == 0) return 0;
  const gpu::Stream stream;
  const gpu::PinnedBuffer<std::byte> host(piece);
  const gpu::DeviceBuffer<std::byte> device(piece, stream);
  const auto copy = [&](std::uint64_t size) {
    void* to = to_device ? device.data() : host.data();
    const void* from = to_device ? host.data() : device.data();
    gpu::check(cudaMemcpyAsync(to, from, size, cudaMemcpyDefault, stream.get()));
  };
  copy(piece);
  gpu::Event start, end;
  start.record(stream);
  for (std::uint64_t done = 0; done < bytes; done += piece) copy(std::min(piece, bytes - done));
  end.record(stream);
  end.wait();
  return end.since(start) * 1e-3;
}

}  // namespace isobrick::bench

#include "bench/packed_on_device.h"

#include <algorithm>
#include <cstring>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "bench/median.h"
#include "gpu/memory/cuda_objects.h"
#include "gpu/memory/device_buffer.h"
#include "gpu/packed/decode_kernel.h"
#include "packed/packed_layout.h"

namespace isobrick::bench {
namespace {

std::size_t room_of(std::size_t bytes) { return (bytes + 8 + 255) / 256 * 256; }

}  // namespace

double decode_on_device(ScalarType type, Int3 extent,
                        const std::vector<std::vector<std::byte>>& packed,
                        const std::vector<std::vector<std::byte>>& samples, std::size_t copies) {
  const std::size_t bricks = packed.size() * copies, brick_bytes = samples.front().size();
  std::size_t room = 0;
  for (const auto& brick : packed) room += room_of(brick.size());
  gpu::DeviceBuffer<std::byte> from(room * copies), to(bricks * brick_bytes);
  gpu::DeviceBuffer<unsigned long long> failed(1);
  // Launches of few bricks, as they come when bricks are streamed, leave most of a GPU idle.
  std::vector<gpu::Stream> streams;
  for (int i = 0; i < 8; ++i) streams.emplace_back();
  gpu::check(cudaMemset(failed.data(), 0xff, failed.bytes()));
  std::vector<gpu::DecodeParams> launches;
  std::byte* at = from.data();
  for (std::size_t i = 0; i < bricks; ++i) {
    const auto& brick = packed[i % packed.size()];
    gpu::check(cudaMemcpy(at, brick.data(), brick.size(), cudaMemcpyHostToDevice));
    if (i % gpu::DecodeParams::kMax == 0) {
      launches.push_back(gpu::decode_params(extent));
      launches.back().failed = failed.data();
    }
    gpu::DecodeParams& p = launches.back();
    const isobrick::packed::BrickLayout layout(type, extent, brick);
    p.bricks[p.count++] = {reinterpret_cast<const std::uint8_t*>(at), to.data() + i * brick_bytes,
                           static_cast<std::uint32_t>(layout.entries()), layout.is_plain(), i};
    at += room_of(brick.size());
  }
  std::vector<double> seconds;
  gpu::Event begin, end;
  std::vector<gpu::Event> over(streams.size());
  for (int run = 0; run < 6; ++run) {
    begin.record(streams[0]);
    for (const gpu::Stream& stream : streams)
      gpu::check(cudaStreamWaitEvent(stream.get(), begin.get()));
    for (std::size_t i = 0; i < launches.size(); ++i)
      gpu::launch_decode(type, launches[i], streams[i % streams.size()].get());
    for (std::size_t i = 1; i < streams.size(); ++i) {
      over[i].record(streams[i]);
      gpu::check(cudaStreamWaitEvent(streams[0].get(), over[i].get()));
    }
    end.record(streams[0]);
    streams[0].wait();
    if (run > 0) seconds.push_back(1e-3 * static_cast<double>(end.since(begin)));
  }
  unsigned long long number = 0;
  gpu::check(cudaMemcpy(&number, failed.data(), sizeof number, cudaMemcpyDeviceToHost));
  if (number != ~0ull) throw Error("a brick was found damaged");
  std::vector<std::byte> found(brick_bytes);
  for (std::size_t i = 0; i < bricks; i += i < packed.size() ? 1 : 97) {
    gpu::check(
        cudaMemcpy(found.data(), to.data() + i * brick_bytes, brick_bytes, cudaMemcpyDeviceToHost));
    if (found != samples[i % packed.size()]) throw Error("the GPU decodes other samples");
  }
  return median(seconds);
}

}  // namespace isobrick::bench

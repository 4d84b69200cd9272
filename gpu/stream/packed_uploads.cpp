#include "gpu/stream/packed_uploads.h"

#include <algorithm>

#include "gpu/memory/nvtx_range.h"
#include "gpu/packed/decode_kernel.h"
#include "packed/packed_layout.h"

namespace isobrick::inline v0::gpu {

PackedUploads::PackedUploads(const Lattice& lattice, std::size_t buffers)
    : lattice_(lattice),
      buffer_bytes_(packed_room(lattice)),
      loads_(buffers),
      memory_(buffers * buffer_bytes_),
      failed_(1) {
  check(cudaMemcpy(failed_.data(), &kNoBrick, failed_.bytes(), cudaMemcpyHostToDevice));
}

PackedUploads::~PackedUploads() { (void)cudaStreamSynchronize(order_.get()); }

void PackedUploads::set(std::size_t buffer, std::span<const std::byte> packed, Int3 brick,
                        ValueRange<double> range) {
  const packed::BrickLayout layout(lattice_.type, lattice_.brick, packed);
  loads_[buffer] = {packed.size(), static_cast<std::uint32_t>(layout.entries()), layout.is_plain(),
                    brick, range};
}

void PackedUploads::decode(std::span<const UploadTracker::PendingBrick> bricks,
                           const Stream& copies) {
  const NvtxRange range("decode packed bricks");
  DecodeStream& own = streams_[calls_++ % kStreams];
  own.copied.record(copies);
  check(cudaStreamWaitEvent(own.stream.get(), own.copied.get()));
  for (std::size_t i = 0; i < bricks.size(); i += DecodeParams::kMax)
    launch(bricks.subspan(i, std::min<std::size_t>(DecodeParams::kMax, bricks.size() - i)),
           own.stream);
  own.decoded.record(own.stream);
  check(cudaStreamWaitEvent(order_.get(), own.decoded.get()));
}

void PackedUploads::launch(std::span<const UploadTracker::PendingBrick> bricks,
                           const Stream& stream) {
  DecodeParams decode = decode_params(lattice_.brick);
  RangeCheckParams ranges{};
  decode.failed = ranges.failed = failed_.data();
  std::copy_n(decode.extent, 3, ranges.extent);
  for (const UploadTracker::PendingBrick& pending : bricks) {
    const Load& load = loads_[pending.buffer];
    const auto number =
        static_cast<unsigned long long>(linear_index(load.brick, lattice_.bricks()));
    decode.bricks[decode.count++] = {
        reinterpret_cast<const std::uint8_t*>(on_device(pending.buffer)), pending.to, load.palette,
        load.is_plain, number};
    const Int3 inside = lattice_.brick_box(load.brick).extent();
    ranges.bricks[ranges.count++] = {
        pending.to,
        number,
        load.range.lo,
        load.range.hi,
        {static_cast<std::int32_t>(inside.x), static_cast<std::int32_t>(inside.y),
         static_cast<std::int32_t>(inside.z)}};
  }
  launch_decode(lattice_.type, decode, stream.get());
  launch_range_check(lattice_.type, ranges, stream.get());
}

}  // namespace isobrick::gpu

#include "gpu/search/span_build.h"

#include "gpu/search/span_items.cuh"

namespace isobrick::inline v0::gpu {
namespace {

void write_headers(const std::vector<IndexHeader>& headers, const BlockWriter& to,
                   const Stream& stream) {
  const DeviceBuffer<IndexHeader> from = upload(headers, stream);
  for_each("write_headers", headers.size(), stream,
           [to, from = from.data()] __device__(std::uint32_t i) {
             *reinterpret_cast<IndexHeader*>(to.block(i)) = from[i];
           });
}

}  // namespace

PendingBlocks::PendingBlocks(std::vector<IndexHeader> headers, const Stream& stream) {
  std::uint64_t bytes = 0;
  for (IndexHeader& header : headers) {
    header.bytes = index_detail::block_bytes(header);
    blocks.offsets.push_back(bytes);
    bytes += header.bytes;  // a multiple of 8
  }
  blocks.bytes = DeviceBuffer<std::byte>(bytes, stream);
  check(cudaMemsetAsync(blocks.bytes.data(), 0, bytes, stream.get()));
  offsets = upload(blocks.offsets, stream);
  write_headers(headers, writer(), stream);
  blocks.headers = std::move(headers);
}

IndexBlocks build_indices(const RangesOfIndices& input, const Stream& stream) {
  const IndexHeader& like = input.headers.at(0);
  return visit_scalar(like.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    const RangeBatch<T> batch{static_cast<const ValueRange<T>*>(input.ranges), input.first.back(),
                              static_cast<std::uint32_t>(input.headers.size()),
                              upload(input.first, stream), input.headers};
    switch (like.kind) {
      case IndexKind::interval: return build_interval_tree(batch, stream);
      case IndexKind::kdtree: return build_kd_tree(batch, stream);
      case IndexKind::quadtree: return build_quadtree(batch, stream);
      case IndexKind::octree: return build_octree(batch, stream);
      case IndexKind::linear: break;
    }
    return build_linear(batch, stream);
  });
}

}  // namespace isobrick::gpu

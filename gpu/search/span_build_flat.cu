#include "gpu/search/span_items.cuh"
#include "index/instantiate.h"

// The structures whose items keep their places: linear scan and octree.

namespace isobrick::inline v0::gpu {
namespace {

template <class T>
PendingBlocks count_stored(const RangeBatch<T>& batch, const Stream& stream) {
  const DeviceBuffer<std::uint32_t> places = place_stored(batch, stream);
  const auto first = download(gather(places.data(), batch.first, stream), stream);
  std::vector<IndexHeader> headers = batch.headers;
  for (std::size_t i = 0; i < headers.size(); ++i) headers[i].stored = first[i + 1] - first[i];
  return PendingBlocks(std::move(headers), stream);
}

/// A level of an octree, from the extents of its grid.
struct OctreeLevel {
  std::uint64_t first, nodes;
  std::uint32_t extent[3];
};

/// False where the tree ends before that level.
__host__ __device__ inline bool find_level(const IndexHeader& header, int level, OctreeLevel& at) {
  at = {0, header.items, {header.grid[0], header.grid[1], header.grid[2]}};
  for (int l = 0; l < level; ++l) {
    if (at.nodes <= 1) return false;
    at.first += at.nodes;
    at.nodes = 1;
    for (std::uint32_t& e : at.extent) {
      e = e / 2 + e % 2;
      at.nodes *= e;
    }
  }
  return true;
}

/// The range of a node from its children's.
template <class T>
__device__ ValueRange<T> reduce(const ValueRange<T>* below, const OctreeLevel& from,
                                const OctreeLevel& level, std::uint64_t node) {
  const std::uint64_t x = 2 * (node % level.extent[0]),
                      y = 2 * (node / level.extent[0] % level.extent[1]),
                      z = 2 * (node / level.extent[0] / level.extent[1]);
  ValueRange<T> range;
  for (std::uint64_t w = z; w < z + 2 && w < from.extent[2]; ++w)
    for (std::uint64_t v = y; v < y + 2 && v < from.extent[1]; ++v)
      for (std::uint64_t u = x; u < x + 2 && u < from.extent[0]; ++u)
        range.include(below[(w * from.extent[1] + v) * from.extent[0] + u]);
  return range;
}

/// Blocks along y take indices, blocks along x the nodes of one.
template <class T>
__global__ void __launch_bounds__(256)
    reduce_level(const BlockWriter to, std::uint32_t owners, int number) {
  for (std::uint32_t owner = blockIdx.y; owner < owners; owner += gridDim.y) {
    OctreeLevel level, from;
    if (!find_level(to.header(owner), number, level)) continue;
    find_level(to.header(owner), number - 1, from);
    SectionCursor cursor(to.block(owner));
    auto* ranges = index_detail::writable(cursor.take<ValueRange<T>>(0));
    for (std::uint64_t i = blockIdx.x * 256ull + threadIdx.x; i < level.nodes;
         i += gridDim.x * 256ull)
      ranges[level.first + i] = reduce(ranges + from.first, from, level, i);
  }
}

}  // namespace

template <class T>
IndexBlocks build_linear(const RangeBatch<T>& batch, const Stream& stream) {
  PendingBlocks pending = count_stored(batch, stream);
  for_each("write_ranges", batch.items, stream,
           [to = pending.writer(), ranges = batch.ranges, first = batch.first.data(),
            owners = batch.owners] __device__(std::uint32_t i) {
             const std::uint32_t owner = owner_of(first, owners, i);
             const auto view = to.view<LinearView<T>>(owner);
             const ValueRange<T> range = index_detail::canonical(ranges[i]);
             index_detail::writable(view.mins)[i - first[owner]] = range.lo;
             index_detail::writable(view.maxs)[i - first[owner]] = range.hi;
           });
  return pending.finish(stream);
}

template <class T>
IndexBlocks build_octree(const RangeBatch<T>& batch, const Stream& stream) {
  PendingBlocks pending = count_stored(batch, stream);
  for_each("write_items", batch.items, stream,
           [to = pending.writer(), ranges = batch.ranges, first = batch.first.data(),
            owners = batch.owners] __device__(std::uint32_t i) {
             const std::uint32_t owner = owner_of(first, owners, i);
             SectionCursor cursor(to.block(owner));
             auto* out = index_detail::writable(cursor.take<ValueRange<T>>(0));
             out[i - first[owner]] = index_detail::canonical(ranges[i]);
           });
  for (int number = 1;; ++number) {
    std::uint64_t most = 0;
    for (const IndexHeader& header : batch.headers) {
      OctreeLevel level;
      if (find_level(header, number, level)) most = std::max(most, level.nodes);
    }
    if (most == 0) break;
    const dim3 grid(static_cast<unsigned>(std::min<std::uint64_t>((most + 255) / 256, 4096)),
                    std::min(batch.owners, 65535u));
    reduce_level<T><<<grid, 256, 0, stream.get()>>>(pending.writer(), batch.owners, number);
    check_launch("reduce_level");
  }
  return pending.finish(stream);
}

#define ISOBRICK_INSTANTIATE(T)                                              \
  template IndexBlocks build_linear<T>(const RangeBatch<T>&, const Stream&); \
  template IndexBlocks build_octree<T>(const RangeBatch<T>&, const Stream&);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick::gpu

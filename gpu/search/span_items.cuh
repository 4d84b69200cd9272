#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include <isobrick/range.h>
#include "core/partition_point.h"
#include "gpu/search/span_build.h"
#include "gpu/search/span_sort.h"
#include "index/span_index.h"
#include "index/span_items.h"

// What the builders on the device share. All of them make several indices at
// once: their items lie index by index, and "owner" is the number of an index.

namespace isobrick::inline v0::gpu {

template <class F>
__global__ void __launch_bounds__(256) each_of(std::uint32_t n, F f) {
  for (std::uint64_t i = blockIdx.x * 256ull + threadIdx.x; i < n; i += gridDim.x * 256ull)
    f(static_cast<std::uint32_t>(i));
}

/// Calls f(i) on the device for each i below n; `name` is for errors.
template <class F>
void for_each(const char* name, std::uint64_t n, const Stream& stream, F f) {
  if (n == 0) return;
  const auto blocks = static_cast<unsigned>(std::min<std::uint64_t>((n + 255) / 256, 1u << 16));
  each_of<<<blocks, 256, 0, stream.get()>>>(static_cast<std::uint32_t>(n), f);
  check_launch(name);
}

template <class T>
DeviceBuffer<T> upload(const std::vector<T>& values, const Stream& stream) {
  DeviceBuffer<T> buffer(values.size(), stream);
  if (!values.empty())
    check(cudaMemcpyAsync(buffer.data(), values.data(), buffer.bytes(), cudaMemcpyHostToDevice,
                          stream.get()));
  return buffer;
}

/// Waits for the stream.
template <class T>
std::vector<T> download(const DeviceBuffer<T>& buffer, const Stream& stream) {
  std::vector<T> values(buffer.size());
  if (!values.empty())
    check(cudaMemcpyAsync(values.data(), buffer.data(), buffer.bytes(), cudaMemcpyDeviceToHost,
                          stream.get()));
  stream.wait();
  return values;
}

/// How many of n values, ascending, are below v, and below or equal.
template <class Key>
__device__ std::uint32_t count_below(const Key* values, std::uint32_t n, Key v) {
  return partition_point(n, [&](std::uint32_t i) { return values[i] < v; });
}
template <class Key>
__device__ std::uint32_t count_up_to(const Key* values, std::uint32_t n, Key v) {
  return partition_point(n, [&](std::uint32_t i) { return values[i] <= v; });
}

/// The last i below `count` with first[i] <= at; there is one.
__device__ inline std::uint32_t owner_of(const std::uint32_t* first, std::uint32_t count,
                                         std::uint32_t at) {
  return count_up_to(first, count, at) - 1;
}

/// Bits that numbers below n take.
inline int bits_below(std::uint64_t n) { return n > 1 ? std::bit_width(n - 1) : 0; }

/// Bounds of ranges as unsigned integers of the same order (order_key), widened
/// to what the sorts know.
template <class T>
using BoundKey = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
template <class T>
inline constexpr int kBoundBits = 8 * sizeof(T);

template <class T>
__host__ __device__ BoundKey<T> key_of(T v) {
  return index_detail::order_key(index_detail::canonical(v));
}

/// The value with that order_key.
template <class T>
__host__ __device__ T value_of(BoundKey<T> key) {
  using Key = index_detail::OrderKey<T>;
  constexpr Key sign = static_cast<Key>(Key{1} << (8 * sizeof(T) - 1));
  const Key k = static_cast<Key>(key);
  if constexpr (std::is_floating_point_v<T>)
    return std::bit_cast<T>(static_cast<Key>(k & sign ? k ^ sign : ~k));
  else if constexpr (std::is_signed_v<T>)
    return std::bit_cast<T>(static_cast<Key>(k ^ sign));
  else
    return k;
}

/// The ranges of the indices that are to be built.
template <class T>
struct RangeBatch {
  const ValueRange<T>* ranges;
  std::uint32_t items, owners;
  DeviceBuffer<std::uint32_t> first;  ///< owners + 1
  std::vector<IndexHeader> headers;
};

/// The items that some isovalue stabs, by owner, then id.
template <class Key>
struct DeviceItems {
  std::uint32_t n = 0;
  std::vector<std::uint32_t> host_first;  ///< of each owner, and n
  DeviceBuffer<std::uint32_t> first;      ///< the same
  DeviceBuffer<std::uint32_t> id, owner;
  DeviceBuffer<Key> lo, hi;
};

/// values[at[i]] for each i.
inline DeviceBuffer<std::uint32_t> gather(const std::uint32_t* values,
                                          const DeviceBuffer<std::uint32_t>& at,
                                          const Stream& stream) {
  DeviceBuffer<std::uint32_t> out(at.size(), stream);
  for_each("gather", at.size(), stream,
           [out = out.data(), values, at = at.data()] __device__(std::uint32_t i) {
             out[i] = values[at[i]];
           });
  return out;
}

/// Places of the stored items among all stored ones, and their number behind.
template <class T>
DeviceBuffer<std::uint32_t> place_stored(const RangeBatch<T>& batch, const Stream& stream) {
  DeviceBuffer<std::uint32_t> places(std::size_t{batch.items} + 1, stream);
  for_each(
      "flag_stored", places.size(), stream,
      [places = places.data(), ranges = batch.ranges, n = batch.items] __device__(std::uint32_t i) {
        places[i] = i < n && index_detail::can_be_active(ranges[i]) ? 1 : 0;
      });
  exclusive_sum(places.data(), places.data(), batch.items + 1, stream);
  return places;
}

template <class T>
DeviceItems<BoundKey<T>> collect(const RangeBatch<T>& batch, const Stream& stream) {
  using Key = BoundKey<T>;
  const DeviceBuffer<std::uint32_t> places = place_stored(batch, stream);
  DeviceItems<Key> items;
  items.first = gather(places.data(), batch.first, stream);
  items.host_first = download(items.first, stream);
  items.n = items.host_first.back();
  items.id = DeviceBuffer<std::uint32_t>(items.n, stream);
  items.owner = DeviceBuffer<std::uint32_t>(items.n, stream);
  items.lo = DeviceBuffer<Key>(items.n, stream);
  items.hi = DeviceBuffer<Key>(items.n, stream);
  for_each("collect", batch.items, stream,
           [ranges = batch.ranges, places = places.data(), first = batch.first.data(),
            owners = batch.owners, id = items.id.data(), owner = items.owner.data(),
            lo = items.lo.data(), hi = items.hi.data()] __device__(std::uint32_t i) {
             const ValueRange<T> range = ranges[i];
             if (!index_detail::can_be_active(range)) return;
             const std::uint32_t at = places[i], own = owner_of(first, owners, i);
             id[at] = i - first[own];
             owner[at] = own;
             lo[at] = key_of(range.lo);
             hi[at] = key_of(range.hi);
           });
  return items;
}

/// 0, 1, 2, ….
inline DeviceBuffer<std::uint32_t> first_order(std::uint32_t n, const Stream& stream) {
  DeviceBuffer<std::uint32_t> order(n, stream);
  for_each("first_order", n, stream,
           [order = order.data()] __device__(std::uint32_t i) { order[i] = i; });
  return order;
}

inline DeviceBuffer<std::uint32_t> copy_of(const DeviceBuffer<std::uint32_t>& from,
                                           const Stream& stream) {
  DeviceBuffer<std::uint32_t> to(from.size(), stream);
  if (from.size() > 0)
    check(cudaMemcpyAsync(to.data(), from.data(), from.bytes(), cudaMemcpyDeviceToDevice,
                          stream.get()));
  return to;
}

/// Sorts item numbers by source[number], of that many bits; stable. Returns the
/// sorted keys.
template <class Key>
DeviceBuffer<Key> sort_order(DeviceBuffer<std::uint32_t>& order, const Key* source, int bits,
                             const Stream& stream) {
  const auto n = static_cast<std::uint32_t>(order.size());
  DeviceBuffer<Key> keys(n, stream);
  for_each("gather_keys", n, stream,
           [keys = keys.data(), order = order.data(), source] __device__(std::uint32_t i) {
             keys[i] = source[order[i]];
           });
  sort_pairs(keys, order, n, bits, stream);
  return keys;
}

/// The blocks while they are filled.
struct BlockWriter {
  std::byte* bytes;
  const std::uint64_t* offsets;

  __device__ std::byte* block(std::uint32_t owner) const { return bytes + offsets[owner]; }
  __device__ const IndexHeader& header(std::uint32_t owner) const {
    return *reinterpret_cast<const IndexHeader*>(block(owner));
  }
  template <class View>
  __device__ View view(std::uint32_t owner) const {
    return index_detail::view_of<View>(header(owner), block(owner));
  }
};

/// Zeroed blocks of headers whose counts are known, their headers in place.
struct PendingBlocks {
  IndexBlocks blocks;
  DeviceBuffer<std::uint64_t> offsets;

  PendingBlocks(std::vector<IndexHeader> headers, const Stream& stream);
  BlockWriter writer() const { return {blocks.bytes.data(), offsets.data()}; }
  /// Waits until the blocks are filled.
  IndexBlocks finish(const Stream& stream) {
    stream.wait();
    return std::move(blocks);
  }
};

template <class T>
IndexBlocks build_linear(const RangeBatch<T>& batch, const Stream& stream);
template <class T>
IndexBlocks build_octree(const RangeBatch<T>& batch, const Stream& stream);
template <class T>
IndexBlocks build_kd_tree(const RangeBatch<T>& batch, const Stream& stream);
template <class T>
IndexBlocks build_interval_tree(const RangeBatch<T>& batch, const Stream& stream);
template <class T>
IndexBlocks build_quadtree(const RangeBatch<T>& batch, const Stream& stream);

}  // namespace isobrick::gpu

#include "gpu/search/span_sort.h"

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <utility>

namespace isobrick::inline v0::gpu {
namespace {

/// Calls run(memory, bytes) twice: for the size of temporary memory, and with it.
template <class F>
void with_memory(const Stream& stream, F run) {
  std::size_t bytes = 0;
  check(run(nullptr, bytes));
  const DeviceBuffer<std::byte> memory(bytes, stream);
  check(run(memory.data(), bytes));
}

template <class Key>
void sort(DeviceBuffer<Key>& keys, DeviceBuffer<std::uint32_t>& values, std::uint32_t n, int bits,
          const Stream& stream) {
  if (n < 2 || bits == 0) return;
  DeviceBuffer<Key> other_keys(keys.size(), stream);
  DeviceBuffer<std::uint32_t> other_values(values.size(), stream);
  cub::DoubleBuffer<Key> k(keys.data(), other_keys.data());
  cub::DoubleBuffer<std::uint32_t> v(values.data(), other_values.data());
  with_memory(stream, [&](void* memory, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(memory, bytes, k, v, n, 0, bits, stream.get());
  });
  if (k.Current() != keys.data()) std::swap(keys, other_keys);
  if (v.Current() != values.data()) std::swap(values, other_values);
}

struct Lesser {
  template <class Key>
  __host__ __device__ GroupValue<Key> operator()(const GroupValue<Key>& a,
                                                 const GroupValue<Key>& b) const {
    return b.group < a.group || (b.group == a.group && b.value < a.value) ? b : a;
  }
};

template <class Key>
void scan_least(GroupValue<Key>* values, std::uint32_t n, const Stream& stream) {
  if (n < 2) return;
  with_memory(stream, [&](void* memory, std::size_t& bytes) {
    return cub::DeviceScan::InclusiveScan(memory, bytes, values, values, Lesser{}, n, stream.get());
  });
}

}  // namespace

void exclusive_sum(const std::uint32_t* in, std::uint32_t* out, std::uint32_t n,
                   const Stream& stream) {
  if (n == 0) return;
  with_memory(stream, [&](void* memory, std::size_t& bytes) {
    return cub::DeviceScan::ExclusiveSum(memory, bytes, in, out, n, stream.get());
  });
}

void sort_pairs(DeviceBuffer<std::uint32_t>& keys, DeviceBuffer<std::uint32_t>& values,
                std::uint32_t n, int bits, const Stream& stream) {
  sort(keys, values, n, bits, stream);
}
void sort_pairs(DeviceBuffer<std::uint64_t>& keys, DeviceBuffer<std::uint32_t>& values,
                std::uint32_t n, int bits, const Stream& stream) {
  sort(keys, values, n, bits, stream);
}

void least_so_far(GroupValue<std::uint32_t>* values, std::uint32_t n, const Stream& stream) {
  scan_least(values, n, stream);
}
void least_so_far(GroupValue<std::uint64_t>* values, std::uint32_t n, const Stream& stream) {
  scan_least(values, n, stream);
}

}  // namespace isobrick::gpu

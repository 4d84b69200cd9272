#pragma once

#include <cstdint>

#include "gpu/memory/device_buffer.h"

// Sorting and scanning in device memory, in the order of a stream. Temporary
// memory comes from the stream's pool and goes back to it.

namespace isobrick::inline v0::gpu {

/// out[i] = in[0] + … + in[i − 1], modulo 2³².
void exclusive_sum(const std::uint32_t* in, std::uint32_t* out, std::uint32_t n,
                   const Stream& stream);

/// Sorts `keys` ascending by their lower `bits` bits and `values` with them;
/// stable. Both have n elements.
void sort_pairs(DeviceBuffer<std::uint32_t>& keys, DeviceBuffer<std::uint32_t>& values,
                std::uint32_t n, int bits, const Stream& stream);
void sort_pairs(DeviceBuffer<std::uint64_t>& keys, DeviceBuffer<std::uint32_t>& values,
                std::uint32_t n, int bits, const Stream& stream);

/// A value of one of several groups, in the order of the groups first.
template <class Key>
struct GroupValue {
  Key group, value;  // of one width: no byte between them is undefined
};

/// Replaces each of n elements by the least of it and those before.
void least_so_far(GroupValue<std::uint32_t>* values, std::uint32_t n, const Stream& stream);
void least_so_far(GroupValue<std::uint64_t>* values, std::uint32_t n, const Stream& stream);

}  // namespace isobrick::gpu

#pragma once

#include <cstdint>
#include <vector>

#include "gpu/memory/device_buffer.h"
#include "index/index_format.h"

namespace isobrick::inline v0::gpu {

/// Indices of one kind and type in device memory, one after the other.
struct IndexBlocks {
  std::vector<IndexHeader> headers;
  std::vector<std::uint64_t> offsets;  ///< of each block
  DeviceBuffer<std::byte> bytes;
};

/// Where the ranges of several indices lie: those of index i from first[i] on, in
/// device memory, of the headers' type.
struct RangesOfIndices {
  const void* ranges;
  std::vector<std::uint32_t> first;  ///< one more than headers
  /// Made by header_for: nothing is counted yet.
  std::vector<IndexHeader> headers;
};

/// Builds the indices on the device: the bytes of build_index. Waits for the
/// stream several times, since the sizes of the arrays follow from the ranges.
IndexBlocks build_indices(const RangesOfIndices& input, const Stream& stream);

}  // namespace isobrick::gpu

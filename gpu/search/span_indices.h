#pragma once

#include <cstdint>
#include <vector>

#include "gpu/search/span_build.h"
#include "gpu/search/span_kernels.h"

namespace isobrick::inline v0::gpu {

/// Indices in device memory, and for each of their items whether the isovalue of
/// the last search stabs it. All work happens in the order of one stream.
class SpanIndices {
 public:
  SpanIndices(IndexBlocks blocks, const Stream& stream);

  /// Launches a search. One index is searched by the whole device, several by
  /// blocks of threads each.
  void search(double isovalue, const Stream& stream);

  const std::vector<IndexHeader>& headers() const { return blocks_.headers; }
  const std::byte* block(std::size_t i) const { return blocks_.bytes.data() + blocks_.offsets[i]; }
  /// Bit i & 31 of word i >> 5: item i. Each index begins a word of its own.
  const std::uint32_t* mask() const { return mask_.data(); }
  /// The mask in ranges, index by index, and the first range of each index.
  const DeviceBuffer<MaskRange>& ranges() const { return ranges_; }
  const std::vector<std::uint32_t>& first_ranges() const { return first_ranges_; }
  /// Bytes of the indices, and of all device memory.
  std::uint64_t index_bytes() const { return blocks_.bytes.bytes(); }
  std::uint64_t bytes() const;

 private:
  IndexBlocks blocks_;
  std::vector<std::uint32_t> first_ranges_;
  DeviceBuffer<MaskRange> ranges_;
  DeviceBuffer<IndexPlace> places_;
  DeviceBuffer<std::uint32_t> mask_;  ///< and the number of runs that wait
  DeviceBuffer<Run> runs_;
  std::uint32_t max_items_ = 0;  ///< of an index
};

/// Uploads indices of one kind and type as they are. Throws UsageError when they
/// are none, or not alike.
IndexBlocks upload_indices(const std::vector<IndexView>& indices, const Stream& stream);

}  // namespace isobrick::gpu

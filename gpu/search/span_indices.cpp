#include "gpu/search/span_indices.h"

#include <algorithm>

#include <isobrick/error.h>

namespace isobrick::inline v0::gpu {
namespace {

template <class T>
DeviceBuffer<T> to_device(const std::vector<T>& values, const Stream& stream) {
  DeviceBuffer<T> buffer(values.size(), stream);
  if (!values.empty())
    check(cudaMemcpyAsync(buffer.data(), values.data(), buffer.bytes(), cudaMemcpyHostToDevice,
                          stream.get()));
  return buffer;
}

}  // namespace

SpanIndices::SpanIndices(IndexBlocks blocks, const Stream& stream) : blocks_(std::move(blocks)) {
  std::vector<MaskRange> ranges;
  std::vector<IndexPlace> places;
  std::uint64_t words = 0;
  for (std::size_t i = 0; i < headers().size(); ++i) {
    const std::uint32_t items = headers()[i].items, own = items / 32 + (items % 32 ? 1 : 0);
    places.push_back({blocks_.offsets[i], words});
    first_ranges_.push_back(static_cast<std::uint32_t>(ranges.size()));
    for (std::uint32_t at = 0; at < own; at += MaskRange::kWords)
      ranges.push_back({words + at, std::min(own - at, MaskRange::kWords), 32 * at});
    words += own;
    max_items_ = std::max(max_items_, items);
  }
  first_ranges_.push_back(static_cast<std::uint32_t>(ranges.size()));
  ranges_ = to_device(ranges, stream);
  places_ = to_device(places, stream);
  mask_ = DeviceBuffer<std::uint32_t>(words + 1, stream);
  if (headers().size() == 1 && headers()[0].kind == IndexKind::quadtree)
    runs_ = DeviceBuffer<Run>(RunQueue::room_for(headers()[0].stored), stream);
}

void SpanIndices::search(double isovalue, const Stream& stream) {
  check(cudaMemsetAsync(mask_.data(), 0, mask_.bytes(), stream.get()));
  const RunQueue later{runs_.data(), mask_.data() + mask_.size() - 1,
                       static_cast<std::uint32_t>(runs_.size())};
  const IndexView like(headers()[0], blocks_.bytes.data());
  if (headers().size() == 1)
    launch_search_one(like, isovalue, mask_.data(), later, stream.get());
  else
    launch_search_many(like, blocks_.bytes.data(), places_.data(),
                       static_cast<std::uint32_t>(headers().size()), max_items_, isovalue,
                       mask_.data(), stream.get());
}

std::uint64_t SpanIndices::bytes() const {
  return blocks_.bytes.bytes() + ranges_.bytes() + places_.bytes() + mask_.bytes() + runs_.bytes();
}

IndexBlocks upload_indices(const std::vector<IndexView>& indices, const Stream& stream) {
  if (indices.empty()) throw UsageError("a search on the device needs an index");
  IndexBlocks blocks;
  std::uint64_t bytes = 0;
  for (const IndexView& index : indices) {
    if (index.kind() != indices[0].kind() || index.type() != indices[0].type())
      throw UsageError("indices that are searched together are of one kind and type");
    blocks.headers.push_back(index.header());
    blocks.offsets.push_back(bytes);
    bytes += index.bytes();
  }
  blocks.bytes = DeviceBuffer<std::byte>(bytes, stream);
  // Small indices are copied many at a time.
  constexpr std::size_t kStaging = std::size_t{4} << 20;
  std::vector<std::byte> staging;
  std::uint64_t copied = 0;
  const auto copy = [&](const std::byte* from, std::size_t n) {
    if (n > 0)
      check(cudaMemcpyAsync(blocks.bytes.data() + copied, from, n, cudaMemcpyHostToDevice,
                            stream.get()));
    copied += n;
  };
  const auto flush = [&] {
    copy(staging.data(), staging.size());
    stream.wait();
    staging.clear();
  };
  for (const IndexView& index : indices) {
    if (staging.size() + index.bytes() > kStaging) flush();
    if (index.bytes() > kStaging)
      copy(index.block(), index.bytes());
    else
      staging.insert(staging.end(), index.block(), index.block() + index.bytes());
  }
  flush();
  return blocks;
}

}  // namespace isobrick::gpu

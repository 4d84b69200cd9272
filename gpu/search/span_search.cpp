#include "gpu/search/span_search.h"

#include <algorithm>
#include <limits>
#include <string>

#include <isobrick/error.h>
#include "gpu/memory/nvtx_range.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/search/span_indices.h"
#include "index/instantiate.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Where the ranges of each grid begin, and what is to be built of them.
template <class T>
RangesOfIndices layout_of(IndexKind kind, std::span<const ValueRange<T>> ranges,
                          std::span<const Int3> grids) {
  if (grids.empty()) throw UsageError("a search on the device needs an index");
  if (ranges.size() >= std::numeric_limits<std::uint32_t>::max())
    throw UsageError("less than 2^32 - 1 ranges can be indexed at a time, not " +
                     std::to_string(ranges.size()));
  RangesOfIndices input;
  std::size_t used = 0;
  for (const Int3& grid : grids) {
    input.first.push_back(static_cast<std::uint32_t>(used));
    const bool positive = grid.x > 0 && grid.y > 0 && grid.z > 0;
    const auto left = static_cast<Index>(ranges.size() - used);
    const bool fits =
        positive && grid.x <= left && grid.y <= left / grid.x && grid.z <= left / (grid.x * grid.y);
    // header_for refuses grids that are too large for what is left.
    const std::size_t items = !positive ? 0
                              : fits    ? static_cast<std::size_t>(volume(grid))
                                        : static_cast<std::size_t>(left);
    input.headers.push_back(index_detail::header_for(kind, scalar_type_of<T>, items, grid));
    used += items;
  }
  input.first.push_back(static_cast<std::uint32_t>(used));
  if (used != ranges.size())
    throw UsageError("the extents of the indices do not give their " +
                     std::to_string(ranges.size()) + " ranges");
  return input;
}

/// While it lives, freed device memory stays in the pool for the next allocation:
/// without it every wait gives all of it back to the driver.
class PoolKeeper {
 public:
  PoolKeeper() {
    int device = 0;
    check(cudaGetDevice(&device));
    check(cudaDeviceGetDefaultMemPool(&pool_, device));
    check(cudaMemPoolGetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &before_));
    std::uint64_t all = std::numeric_limits<std::uint64_t>::max();
    check(cudaMemPoolSetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &all));
  }
  PoolKeeper(const PoolKeeper&) = delete;
  PoolKeeper& operator=(const PoolKeeper&) = delete;
  ~PoolKeeper() { (void)cudaMemPoolSetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &before_); }

 private:
  cudaMemPool_t pool_ = nullptr;
  std::uint64_t before_ = 0;
};

}  // namespace

struct SpanSearch::Impl {
  Stream stream;
  Event start, end;
  float build_ms = 0;
  SpanIndices indices;
  DeviceBuffer<std::uint32_t> counts, first;  ///< of each range of the mask, one more
  DeviceBuffer<std::uint32_t> ids;
  PinnedBuffer<std::uint32_t> total{1};
  std::uint32_t found = 0;

  explicit Impl(const std::vector<IndexView>& views)
      : indices(upload_indices(views, stream), stream) {
    prepare();
  }

  template <class T>
  Impl(IndexKind kind, std::span<const ValueRange<T>> ranges, std::span<const Int3> grids)
      : indices(build(layout_of(kind, ranges, grids), ranges), stream) {
    prepare();
  }

  template <class T>
  IndexBlocks build(RangesOfIndices input, std::span<const ValueRange<T>> ranges) {
    const NvtxRange range("build indices");
    const DeviceBuffer<ValueRange<T>> on_device(ranges.size(), stream);
    if (!ranges.empty())
      check(cudaMemcpyAsync(on_device.data(), ranges.data(), on_device.bytes(),
                            cudaMemcpyHostToDevice, stream.get()));
    input.ranges = on_device.data();
    const PoolKeeper keeper;
    start.record(stream);
    IndexBlocks blocks = build_indices(input, stream);
    end.record(stream);
    end.wait();
    build_ms = end.since(start);
    return blocks;
  }

  void prepare() {
    counts = DeviceBuffer<std::uint32_t>(indices.ranges().size() + 1, stream);
    first = DeviceBuffer<std::uint32_t>(counts.size(), stream);
    check(cudaMemsetAsync(counts.data(), 0, counts.bytes(), stream.get()));
    check(cudaMemsetAsync(first.data(), 0, first.bytes(), stream.get()));
    stream.wait();
  }

  std::uint32_t mask_ranges() const { return static_cast<std::uint32_t>(indices.ranges().size()); }

  void list() {
    launch_list_bits(indices.mask(), indices.ranges().data(), mask_ranges(), first.data(),
                     ids.data(), ids.size(), stream.get());
  }

  std::uint64_t search(double isovalue) {
    if (mask_ranges() == 0) return 0;
    const NvtxRange range("search indices");
    start.record(stream);
    indices.search(isovalue, stream);
    launch_count_bits(indices.mask(), indices.ranges().data(), mask_ranges(), counts.data(),
                      first.data(), stream.get());
    list();
    end.record(stream);
    check(cudaMemcpyAsync(total.data(), first.data() + mask_ranges(), sizeof(std::uint32_t),
                          cudaMemcpyDeviceToHost, stream.get()));
    stream.wait();
    found = total[0];
    if (found > ids.size()) {
      ids = {};
      ids = DeviceBuffer<std::uint32_t>(std::size_t{found} + found / 4, stream);
      list();
      stream.wait();
    }
    return found;
  }
};

SpanSearch::SpanSearch(const std::vector<IndexView>& indices)
    : impl_(std::make_unique<Impl>(indices)) {}
template <class T>
SpanSearch::SpanSearch(IndexKind kind, std::span<const ValueRange<T>> ranges,
                       std::span<const Int3> grids)
    : impl_(std::make_unique<Impl>(kind, ranges, grids)) {}
SpanSearch::~SpanSearch() = default;
SpanSearch::SpanSearch(SpanSearch&&) noexcept = default;
SpanSearch& SpanSearch::operator=(SpanSearch&&) noexcept = default;

IndexKind SpanSearch::kind() const { return impl_->indices.headers()[0].kind; }
ScalarType SpanSearch::type() const { return impl_->indices.headers()[0].type; }
std::size_t SpanSearch::size() const { return impl_->indices.headers().size(); }
std::uint64_t SpanSearch::index_bytes() const { return impl_->indices.index_bytes(); }
std::uint64_t SpanSearch::device_bytes() const {
  return impl_->indices.bytes() + impl_->counts.bytes() + impl_->first.bytes() + impl_->ids.bytes();
}

std::vector<std::byte> SpanSearch::download(std::size_t i) const {
  std::vector<std::byte> bytes(impl_->indices.headers()[i].bytes);
  check(cudaMemcpyAsync(bytes.data(), impl_->indices.block(i), bytes.size(), cudaMemcpyDeviceToHost,
                        impl_->stream.get()));
  impl_->stream.wait();
  return bytes;
}

std::uint64_t SpanSearch::search(double isovalue) { return impl_->search(isovalue); }

void SpanSearch::answers(std::vector<std::uint32_t>& first, std::vector<std::uint32_t>& ids) const {
  const Impl& i = *impl_;
  std::vector<std::uint32_t> of_ranges(i.first.size());
  ids.resize(i.found);
  check(cudaMemcpyAsync(of_ranges.data(), i.first.data(), i.first.bytes(), cudaMemcpyDeviceToHost,
                        i.stream.get()));
  if (i.found > 0)
    check(cudaMemcpyAsync(ids.data(), i.ids.data(), i.found * sizeof(std::uint32_t),
                          cudaMemcpyDeviceToHost, i.stream.get()));
  i.stream.wait();
  first.clear();
  for (const std::uint32_t range : i.indices.first_ranges()) first.push_back(of_ranges[range]);
}

float SpanSearch::search_milliseconds() const { return impl_->end.since(impl_->start); }
float SpanSearch::build_milliseconds() const { return impl_->build_ms; }

#define ISOBRICK_INSTANTIATE(T) \
  template SpanSearch::SpanSearch(IndexKind, std::span<const ValueRange<T>>, std::span<const Int3>);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick::gpu

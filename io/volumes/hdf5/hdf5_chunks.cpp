#include "io/volumes/hdf5/hdf5_chunks.h"

#include <fmt/format.h>
#include <tbb/info.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/byte_order.h"

namespace isobrick::inline v0 {
namespace {

/// Memory for chunks on their way, and for those that are kept.
constexpr std::size_t kEnoughOnTheirWay = std::size_t{32} << 20;
constexpr std::size_t kEnoughKept = std::size_t{64} << 20;

/// One dimension of a copy: how many samples, and how far apart they are.
struct Dimension {
  Index count, from, to;
};

template <std::size_t kSample>
void copy_apart(const std::byte* from, std::byte* to, const Dimension& d) {
  for (Index i = 0; i < d.count; ++i)
    std::memcpy(to + static_cast<std::size_t>(i * d.to) * kSample,
                from + static_cast<std::size_t>(i * d.from) * kSample, kSample);
}

void copy_row(const std::byte* from, std::byte* to, const Dimension& d, std::size_t sample) {
  if (d.from == 1 && d.to == 1) {
    std::memcpy(to, from, static_cast<std::size_t>(d.count) * sample);
    return;
  }
  switch (sample) {
    case 1: return copy_apart<1>(from, to, d);
    case 2: return copy_apart<2>(from, to, d);
    case 4: return copy_apart<4>(from, to, d);
    default: return copy_apart<8>(from, to, d);
  }
}

/// Copies the first `dimensions` ones, of which the first is a row.
void copy_dimensions(const std::vector<Dimension>& all, std::size_t dimensions,
                     const std::byte* from, std::byte* to, std::size_t sample) {
  const Dimension& d = all[dimensions - 1];
  if (dimensions == 1) return copy_row(from, to, d, sample);
  for (Index i = 0; i < d.count; ++i)
    copy_dimensions(all, dimensions - 1, from + static_cast<std::size_t>(i * d.from) * sample,
                    to + static_cast<std::size_t>(i * d.to) * sample, sample);
}

}  // namespace

Hdf5Chunks::Hdf5Chunks(Hdf5ChunkLayout layout, Hdf5Fetch fetch, int threads)
    : layout_(std::move(layout)),
      fetch_(std::move(fetch)),
      arena_(threads > 0 ? threads : tbb::info::default_concurrency()),
      items_(std::clamp<std::size_t>(kEnoughOnTheirWay / (2 * layout_.encoding.max_packed()), 1,
                                     static_cast<std::size_t>(arena_.max_concurrency()) + 1)),
      max_kept_(layer_bytes() / layout_.encoding.chunk_bytes) {}

/// Of a layer of chunks along all but the slowest axis, or nothing if that is much.
std::size_t Hdf5Chunks::layer_bytes() const {
  double layer = static_cast<double>(layout_.encoding.chunk_bytes);
  for (std::size_t i = 0; i + 1 < layout_.extent.size(); ++i)
    layer *= static_cast<double>(ceil_div(layout_.extent[i], layout_.edge[i]));
  return layer <= static_cast<double>(kEnoughKept) ? static_cast<std::size_t>(layer) : 0;
}

std::size_t Hdf5Chunks::memory() const {
  return items_.size() * 2 * layout_.encoding.max_packed() +
         max_kept_ * layout_.encoding.max_packed();
}

void Hdf5Chunks::read(const std::vector<Index>& start, const std::vector<Index>& count,
                      std::byte* out) {
  const Box box{start, count, out};
  drop_others(box);
  free_.clear();
  for (Item& item : items_) free_.push_back(&item);
  std::vector<Index> next;
  const auto take = [&](tbb::flow_control& flow) -> Item* {
    if (!next_chunk(box, next)) {
      flow.stop();
      return nullptr;
    }
    Item* item;
    {
      const std::lock_guard lock(mutex_);
      item = free_.back();
      free_.pop_back();
    }
    item->first = next;
    fetch(*item);
    return item;
  };
  const auto use = [&](Item* item) {
    decode(*item);
    copy(*item, box);
    finish(*item, box);
  };
  arena_.execute([&] {
    tbb::parallel_pipeline(items_.size(),
                           tbb::make_filter<void, Item*>(tbb::filter_mode::serial_in_order, take) &
                               tbb::make_filter<Item*, void>(tbb::filter_mode::parallel, use));
  });
}

/// The first sample of the chunk after `first`, of the first one if that is empty;
/// false after the last one that the box touches.
bool Hdf5Chunks::next_chunk(const Box& box, std::vector<Index>& first) const {
  const auto lowest = [&](std::size_t i) {
    return box.start[i] / layout_.edge[i] * layout_.edge[i];
  };
  const std::size_t dimensions = box.start.size();
  if (first.empty()) {
    for (std::size_t i = 0; i < dimensions; ++i) first.push_back(lowest(i));
    return true;
  }
  for (std::size_t i = 0; i < dimensions; ++i) {
    first[i] += layout_.edge[i];
    if (first[i] < box.start[i] + box.count[i]) return true;
    first[i] = lowest(i);
  }
  return false;
}

/// Forgets chunks that the box does not touch.
void Hdf5Chunks::drop_others(const Box& box) {
  std::erase_if(kept_, [&](const auto& entry) {
    for (std::size_t i = 0; i < box.start.size(); ++i)
      if (entry.first[i] >= box.start[i] + box.count[i] ||
          entry.first[i] + layout_.edge[i] <= box.start[i])
        return true;
    return false;
  });
}

void Hdf5Chunks::fetch(Item& item) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(item.first);
    item.decoded = found != kept_.end();
    if (item.decoded) {
      item.skipped = 0;
      std::swap(item.buffers.bytes, found->second);
      kept_.erase(found);
      return;
    }
  }
  item.buffers.bytes.reserve(layout_.encoding.max_packed());
  item.buffers.other.reserve(layout_.encoding.max_packed());
  item.skipped = fetch_(item.first, item.buffers.bytes);
}

void Hdf5Chunks::decode(Item& item) const {
  if (!item.skipped || item.decoded) return;
  try {
    undo_filters(layout_.encoding, *item.skipped, item.buffers);
  } catch (const DamageError& error) {
    throw DamageError(fmt::format("'{}': the chunk at [{}] is damaged: {}", layout_.path,
                                  fmt::join(item.first.rbegin(), item.first.rend(), ", "),
                                  error.what()));
  }
  if (layout_.swap)
    swap_byte_order(item.buffers.bytes.data(), layout_.encoding.chunk_bytes / layout_.sample,
                    layout_.sample);
}

/// Copies what the chunk and the box share.
void Hdf5Chunks::copy(const Item& item, const Box& box) const {
  const std::byte* from = item.skipped ? item.buffers.bytes.data() : layout_.fill.data();
  std::byte* to = box.out;
  std::vector<Dimension> dimensions;
  Index from_step = 1, to_step = 1;
  for (std::size_t i = 0; i < box.start.size(); ++i) {
    const Index lo = std::max(item.first[i], box.start[i]);
    const Index hi = std::min(item.first[i] + layout_.edge[i], box.start[i] + box.count[i]);
    if (item.skipped)
      from += static_cast<std::size_t>((lo - item.first[i]) * from_step) * layout_.sample;
    to += static_cast<std::size_t>((lo - box.start[i]) * to_step) * layout_.sample;
    if (hi - lo > 1) dimensions.push_back({hi - lo, item.skipped ? from_step : 0, to_step});
    from_step *= layout_.edge[i];
    to_step *= box.count[i];
  }
  if (dimensions.empty()) dimensions.push_back({1, 1, 1});
  copy_dimensions(dimensions, dimensions.size(), from, to, layout_.sample);
}

void Hdf5Chunks::finish(Item& item, const Box& box) {
  bool cut = false;
  for (std::size_t i = 0; i < box.start.size(); ++i)
    cut = cut || std::min(item.first[i] + layout_.edge[i], layout_.extent[i]) >
                     box.start[i] + box.count[i];
  const std::lock_guard lock(mutex_);
  if (cut && item.skipped && kept_.size() < max_kept_)
    std::swap(kept_[item.first], item.buffers.bytes);
  free_.push_back(&item);
}

}  // namespace isobrick

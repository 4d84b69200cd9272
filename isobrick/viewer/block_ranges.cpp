#include "isobrick/viewer/block_ranges.h"

#include <algorithm>
#include <utility>

#include "isobrick/viewer/brick_source.h"

namespace isobrick {
namespace {

constexpr Index kEdge = StoreReader::kRangeChunk;
constexpr std::uint64_t kChunkBytes = kEdge * kEdge * kEdge * sizeof(ValueRange<double>);

}  // namespace

BlockRanges::BlockRanges(std::shared_ptr<const BrickSource> source, std::uint64_t budget)
    : source_(std::move(source)),
      most_(static_cast<std::size_t>(std::max<std::uint64_t>(budget / kChunkBytes, 1))) {}

std::shared_ptr<const RangeTable> BlockRanges::around(int level, Int3 block) {
  const Key key{level, floor_div(block, {kEdge, kEdge, kEdge})};
  const std::shared_ptr<Chunk> chunk = find(key);
  // Beside other threads, which may read others.
  std::call_once(chunk->once, [&] { chunk->table = read(key); });
  return chunk->table;
}

std::shared_ptr<BlockRanges::Chunk> BlockRanges::find(const Key& key) {
  const std::lock_guard lock(mutex_);
  const auto [found, added] = chunks_.try_emplace(key);
  Entry& entry = found->second;
  if (!added) {
    order_.splice(order_.begin(), order_, entry.order);
    return entry.chunk;
  }
  entry.chunk = std::make_shared<Chunk>();
  order_.push_front(key);
  entry.order = order_.begin();
  const std::shared_ptr<Chunk> chunk = entry.chunk;
  if (chunks_.size() > most_) {
    chunks_.erase(order_.back());
    order_.pop_back();
  }
  return chunk;
}

std::shared_ptr<const RangeTable> BlockRanges::read(const Key& key) const {
  const Lattice& lattice = source_->info().levels[static_cast<std::size_t>(key.level)].lattice;
  const Int3 lo = key.node * kEdge;
  const Box3 box = intersect({lo, lo + Int3{kEdge, kEdge, kEdge}}, {{0, 0, 0}, lattice.blocks()});
  return std::make_shared<const RangeTable>(source_->block_ranges(key.level, box));
}

}  // namespace isobrick

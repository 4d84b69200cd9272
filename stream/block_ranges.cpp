#include "stream/block_ranges.h"

#include <utility>

namespace isobrick::inline v0 {
namespace {

constexpr Index kEdge = StoreReader::kRangeChunk;
constexpr Int3 kChunk{kEdge, kEdge, kEdge};
constexpr std::uint64_t kChunkBytes = kEdge * kEdge * kEdge * sizeof(ValueRange<double>);

}  // namespace

std::uint64_t BlockRanges::number(int level, Int3 chunk) const {
  const Lattice& lattice = source_->info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 chunks = ceil_div(lattice.blocks(), kChunk);
  return static_cast<std::uint64_t>(linear_index(chunk, chunks)) * 64 +
         static_cast<std::uint64_t>(level);
}

std::shared_ptr<const RangeTable> BlockRanges::around(int level, Int3 block) {
  const Int3 chunk = floor_div(block, kChunk);
  const std::shared_ptr<const Chunk> found = chunks_.get(
      number(level, chunk), [] { return std::pair(std::make_shared<const Chunk>(), kChunkBytes); });
  std::call_once(found->once, [&] {
    const Lattice& lattice = source_->info().levels[static_cast<std::size_t>(level)].lattice;
    const Int3 lo = chunk * kEdge;
    found->table = std::make_shared<const RangeTable>(
        source_->block_ranges(level, intersect({lo, lo + kChunk}, {{0, 0, 0}, lattice.blocks()})));
    found->read.store(true, std::memory_order_release);
  });
  return found->table;
}

std::shared_ptr<const RangeTable> BlockRanges::find(int level, Int3 block) {
  const std::shared_ptr<const Chunk> found = chunks_.find(number(level, floor_div(block, kChunk)));
  return found && found->read.load(std::memory_order_acquire) ? found->table : nullptr;
}

}  // namespace isobrick

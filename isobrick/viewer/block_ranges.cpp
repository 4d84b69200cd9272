#include "isobrick/viewer/block_ranges.h"

#include <utility>

namespace isobrick {
namespace {

constexpr Index kEdge = StoreReader::kRangeChunk;
constexpr std::uint64_t kChunkBytes = kEdge * kEdge * kEdge * sizeof(ValueRange<double>);

}  // namespace

std::shared_ptr<const RangeTable> BlockRanges::around(int level, Int3 block) {
  const Int3 edge{kEdge, kEdge, kEdge};
  const Int3 chunk = floor_div(block, edge);
  const Box3 blocks{{0, 0, 0},
                    source_->info().levels[static_cast<std::size_t>(level)].lattice.blocks()};
  const auto number = static_cast<std::uint64_t>(linear_index(chunk, ceil_div(blocks.hi, edge)));
  const std::shared_ptr<const Chunk> found =
      chunks_.get(number * 64 + static_cast<std::uint64_t>(level),
                  [] { return std::pair(std::make_shared<const Chunk>(), kChunkBytes); });
  std::call_once(found->once, [&] {
    const Int3 lo = chunk * kEdge;
    found->table = std::make_shared<const RangeTable>(
        source_->block_ranges(level, intersect({lo, lo + edge}, blocks)));
  });
  return found->table;
}

}  // namespace isobrick

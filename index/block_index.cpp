#include "index/block_index.h"

#include <bit>

#include <isobrick/lattice.h>
#include "core/morton.h"
#include "index/instantiate.h"
#include "index/span_index.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kEdge = kTileEdge / kBlockEdge;

constexpr Int3 block_of_tile(int i) { return {i & 1, i >> 1 & 1, i >> 2}; }

}  // namespace

template <class T>
BlockIndex::BlockIndex(IndexKind kind, Int3 blocks, std::span<const ValueRange<T>> ranges)
    : kind_(kind) {
  const Int3 grid = ceil_div(blocks, {kEdge, kEdge, kEdge});
  tiles_.reserve(static_cast<std::size_t>(volume(grid)));
  for_each_morton(grid, [&](Int3 t) { tiles_.push_back(morton_encode(t)); });
  if (kind == IndexKind::octree) {
    // It lies in space: its items keep their places in the grid.
    bytes_ = build_index<T>(kind, ranges, blocks);
    return;
  }
  // Eight a tile, so that a byte of the mask is a tile; those beyond the border
  // have no range.
  std::vector<ValueRange<T>> ordered(8 * tiles_.size());
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    const Int3 b = tile(i / 8) * kEdge + block_of_tile(static_cast<int>(i % 8));
    if (Box3{{0, 0, 0}, blocks}.contains(b))
      ordered[i] = ranges[static_cast<std::size_t>(linear_index(b, blocks))];
  }
  bytes_ = build_index<T>(kind, ordered, {static_cast<Index>(ordered.size()), 1, 1});
}

Int3 BlockIndex::tile(std::size_t i) const { return morton_decode(tiles_[i]); }

void BlockIndex::append_active_tiles(double isovalue, std::vector<TileWork>& tiles) const {
  const IndexView view = view_index(bytes_);
  if (kind_ == IndexKind::octree) {
    // Morton order of blocks: those of a tile come one after the other.
    std::vector<std::uint32_t> ids;
    query(view, isovalue, ids);
    const Int3 blocks = view.grid();
    for (const std::uint32_t id : ids) {
      const Int3 b = point_at(id, blocks);
      const Int3 t{b.x / kEdge, b.y / kEdge, b.z / kEdge};
      if (tiles.empty() || tiles.back().tile != t) tiles.push_back({.tile = t});
      const auto bit = 1u << ((b.x & 1) | (b.y & 1) << 1 | (b.z & 1) << 2);
      tiles.back().active_blocks = static_cast<std::uint8_t>(tiles.back().active_blocks | bit);
    }
    return;
  }
  std::vector<std::uint64_t> words(mask_words(view.items()));
  mark(view, isovalue, words);
  for (std::size_t w = 0; w < words.size(); ++w)
    for (std::uint64_t word = words[w]; word;) {
      const int byte = std::countr_zero(word) / 8;
      const auto active = static_cast<std::uint8_t>(word >> 8 * byte);
      tiles.push_back(
          {.tile = tile(8 * w + static_cast<std::size_t>(byte)), .active_blocks = active});
      word &= ~(std::uint64_t{0xff} << 8 * byte);
    }
}

#define ISOBRICK_INSTANTIATE(T) \
  template BlockIndex::BlockIndex(IndexKind, Int3, std::span<const ValueRange<T>>);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick

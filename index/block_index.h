#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/range.h>
#include "core/tile.h"

namespace isobrick::inline v0 {

/// The blocks of 16³ cells of a volume in memory, searched through one of the
/// span-space structures. Numbered tile by tile in Morton order, so that the mask
/// of marked blocks is the list of active tiles. Thread-safe once built.
class BlockIndex {
 public:
  /// `ranges` are those of `blocks` (extents), C order [z, y, x]. Throws
  /// UsageError for 2³² blocks and more.
  template <class T>
  BlockIndex(IndexKind kind, Int3 blocks, std::span<const ValueRange<T>> ranges);

  /// Appends the tiles with an active block, in Morton order.
  void append_active_tiles(double isovalue, std::vector<TileWork>& tiles) const;

  IndexKind kind() const { return kind_; }
  /// Of the structure; the order of the tiles takes 8 bytes a tile beside it.
  std::uint64_t bytes() const { return bytes_.size(); }

 private:
  Int3 tile(std::size_t i) const;

  IndexKind kind_;
  std::vector<std::uint64_t> tiles_;  ///< Morton codes of all tiles, ascending
  std::vector<std::byte> bytes_;
};

}  // namespace isobrick

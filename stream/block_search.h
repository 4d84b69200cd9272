#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/store_reader.h>
#include "core/tile.h"
#include "index/active_tiles.h"

namespace isobrick::inline v0 {

/// How the active blocks of a level are searched for.
struct SearchMethod {
  std::optional<IndexKind> kind;  ///< a stored index; nothing: the block ranges
  bool only_if_few = false;       ///< the index only for range chunks where little is active
};

/// Finds the active blocks of a level, one range chunk (the cube of 512³ cells
/// whose block ranges share a file) after the other.
class BlockSearch {
 public:
  virtual ~BlockSearch() = default;

  /// Appends the tiles of a range chunk that lie in `box` (in tiles) and have an
  /// active block, in Morton order. Blocks without an active cell may be among them.
  /// `tiles` has a list for each isovalue.
  virtual void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                            std::span<std::vector<TileWork>> tiles) = 0;

  /// Bytes read from disk so far: of ranges, which StoreReader::bytes_read()
  /// counts as well, and of an index.
  virtual std::uint64_t range_bytes() const { return 0; }
  virtual std::uint64_t index_bytes() const { return 0; }
};

/// The ranges of a range chunk's blocks.
RangeTable read_chunk_ranges(const StoreReader& store, int level, Int3 chunk);

/// All of them give the same surface. An index works in parallel in the caller's
/// TBB arena, in no more than block_search_bytes(). With `cap` also the blocks that capped surfaces
/// need, which only ranges find.
std::unique_ptr<BlockSearch> make_block_search(const StoreReader& store, int level, SearchMethod by,
                                               const std::optional<CapSearch>& cap = {});

/// Memory that such a search takes with so many threads, beyond a range chunk.
std::uint64_t block_search_bytes(const StoreReader& store, int level, SearchMethod by, int threads);

}  // namespace isobrick

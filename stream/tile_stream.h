#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/store_reader.h>
#include "core/tile.h"
#include "core/tile_range.h"
#include "stream/block_search.h"

namespace isobrick::inline v0 {

/// The tiles of a level that are active at an isovalue, or at any of several, in Morton order.
/// They are found range chunk by range chunk: memory does not grow with the volume.
/// Tiles that the caller lists are all in memory.
class TileStream {
 public:
  /// Tiles without a cell in `roi` (samples) are left out. `by` is the search method. With `cap`
  /// also the tiles that capped surfaces need.
  TileStream(const StoreReader& store, int level, std::vector<double> isovalues, Box3 roi,
             SearchMethod by = {}, const std::optional<CapSearch>& cap = {});
  TileStream(const StoreReader& store, int level, double isovalue, Box3 roi, SearchMethod by = {})
      : TileStream(store, level, std::vector<double>{isovalue}, roi, by) {}
  /// The tiles of a box of tiles of `lattice` that `search` finds, as if they were active at one
  /// isovalue.
  TileStream(std::unique_ptr<BlockSearch> search, const Lattice& lattice, Box3 tiles);
  /// These tiles, as if they were active at one isovalue.
  explicit TileStream(std::vector<TileWork> tiles);

  /// From now on only tiles that the mesh of this range needs. Called before anything is looked
  /// for.
  void restrict_to(const TileRange& range);

  /// Looks for the first tiles in one range chunk, so that next() need not; where it has none,
  /// next() goes on.
  void begin();
  /// The next tile with the blocks that any isovalue touches, or nothing at the end.
  std::optional<TileWork> next();
  /// Of the last tile: TileWork::active_blocks for each isovalue.
  std::span<const std::uint8_t> blocks_of_each() const {
    return std::span(blocks_).subspan((next_tile_ - 1) * isovalues_.size(), isovalues_.size());
  }
  std::size_t isovalues() const { return isovalues_.size(); }

  /// What searching has cost so far.
  std::uint64_t range_bytes() const { return search_ ? search_->range_bytes() : 0; }
  std::uint64_t index_bytes() const { return search_ ? search_->index_bytes() : 0; }
  double seconds() const { return seconds_; }

 private:
  void list_chunks(const Lattice& lattice);
  bool load_next_chunk();
  void merge();

  std::unique_ptr<BlockSearch> search_;  ///< null where all tiles are known
  std::vector<double> isovalues_;
  double seconds_ = 0;
  Box3 roi_tiles_;
  TileRange range_;
  std::vector<Int3> chunks_;  ///< range chunks in Morton order
  std::size_t next_chunk_ = 0;
  std::vector<std::vector<TileWork>> tiles_of_;  ///< of the chunk at hand, for each isovalue
  std::vector<TileWork> tiles_;                  ///< of any of them
  std::vector<std::uint8_t> blocks_;             ///< blocks_of_each() of every tile
  std::size_t next_tile_ = 0;
};

/// Tiles that are extracted together, and the bricks that must be resident for it.
struct TileBatch {
  std::vector<TileWork> tiles;                  ///< that any isovalue touches
  std::vector<std::vector<TileWork>> tiles_of;  ///< those that each isovalue touches
  std::vector<Int3> bricks;
};

/// Cuts a tile stream into batches of at most `max_tiles` tiles that need at
/// most `max_bricks` bricks, which must be enough for any single tile
/// (max_bricks_of_tile). With `whole_tiles` all blocks of a tile count as
/// active. Ranges do not include NaN, so where there may be some, every sample is
/// looked at. `reach` as for_each_needed_box().
class BatchPlanner {
 public:
  BatchPlanner(TileStream& tiles, const Lattice& lattice, Index reach, bool whole_tiles,
               std::size_t max_tiles, std::size_t max_bricks)
      : stream_(tiles),
        lattice_(lattice),
        reach_(reach),
        whole_tiles_(whole_tiles),
        max_tiles_(max_tiles),
        max_bricks_(max_bricks) {}

  /// False at the end.
  bool next(TileBatch& batch);

 private:
  TileStream& stream_;
  Lattice lattice_;
  Index reach_;
  bool whole_tiles_;
  std::size_t max_tiles_, max_bricks_;
  std::optional<TileWork> held_;  ///< did not fit the batch before; the stream's last
};

}  // namespace isobrick

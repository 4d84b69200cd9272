#include "stream/tile_stream.h"

#include <algorithm>
#include <utility>

#include "core/flat_map.h"
#include "core/morton.h"
#include "core/stopwatch.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kTileBlocks = kTileEdge / kBlockEdge;
constexpr Index kChunkTiles = StoreReader::kRangeChunk / kTileBlocks;
static_assert((kChunkTiles & (kChunkTiles - 1)) == 0, "ranges of tiles need a power of two");

void append_needed_bricks(const Lattice& lattice, const TileWork& work, Index reach,
                          std::vector<Int3>& bricks) {
  for_each_needed_box(lattice, work, reach, [&](Box3 box) {
    for_each_point(lattice.bricks_of(box), [&](Int3 b) {
      if (std::find(bricks.begin(), bricks.end(), b) == bricks.end()) bricks.push_back(b);
    });
  });
}

}  // namespace

TileStream::TileStream(const StoreReader& store, int level, std::vector<double> isovalues, Box3 roi,
                       SearchMethod by, const std::optional<CapSearch>& cap)
    : search_(make_block_search(store, level, by, cap)),
      isovalues_(std::move(isovalues)),
      tiles_of_(isovalues_.size()) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Box3 samples = intersect(roi, lattice.box());
  // The last sample along an axis begins no cell.
  const Int3 cells_end = max(samples.hi - Int3{1, 1, 1}, samples.lo);
  roi_tiles_ = {{samples.lo.x / kTileEdge, samples.lo.y / kTileEdge, samples.lo.z / kTileEdge},
                ceil_div(cells_end, {kTileEdge, kTileEdge, kTileEdge})};
  list_chunks(lattice);
}

TileStream::TileStream(std::unique_ptr<BlockSearch> search, const Lattice& lattice, Box3 tiles)
    : search_(std::move(search)), isovalues_(1), roi_tiles_(tiles), tiles_of_(1) {
  list_chunks(lattice);
}

void TileStream::list_chunks(const Lattice& lattice) {
  const Int3 chunk{kChunkTiles, kChunkTiles, kChunkTiles};
  for_each_morton(ceil_div(lattice.tiles(), chunk), [&](Int3 c) {
    if (!intersect({c * chunk, (c + Int3{1, 1, 1}) * chunk}, roi_tiles_).empty())
      chunks_.push_back(c);
  });
}

TileStream::TileStream(std::vector<TileWork> tiles) : isovalues_(1), tiles_(std::move(tiles)) {
  blocks_.reserve(tiles_.size());
  for (const TileWork& work : tiles_) blocks_.push_back(work.active_blocks);
}

void TileStream::restrict_to(const TileRange& range) {
  range_ = range;
  std::erase_if(chunks_, [&](Int3 chunk) { return !range.needs(chunk, kChunkTiles); });
}

bool TileStream::load_next_chunk() {
  if (next_chunk_ == chunks_.size()) return false;
  const Stopwatch watch(seconds_);
  for (std::vector<TileWork>& tiles : tiles_of_) tiles.clear();
  search_->append_tiles(chunks_[next_chunk_++], roi_tiles_, isovalues_, tiles_of_);
  if (range_ != TileRange{})
    for (std::vector<TileWork>& tiles : tiles_of_)
      std::erase_if(tiles, [&](const TileWork& work) { return !range_.needs(work.tile); });
  merge();
  return true;
}

/// Of the tiles that come next in the lists, the Morton-first is always the next one.
void TileStream::merge() {
  tiles_.clear();
  blocks_.clear();
  next_tile_ = 0;
  std::vector<std::size_t> next(tiles_of_.size(), 0);
  for (;;) {
    std::uint64_t first = ~std::uint64_t{0};
    TileWork tile;
    for (std::size_t i = 0; i < tiles_of_.size(); ++i) {
      if (next[i] == tiles_of_[i].size()) continue;
      const Int3 candidate = tiles_of_[i][next[i]].tile;
      if (const std::uint64_t code = morton_encode(candidate); code < first) {
        first = code;
        tile.tile = candidate;
      }
    }
    if (first == ~std::uint64_t{0}) return;
    for (std::size_t i = 0; i < tiles_of_.size(); ++i) {
      const bool is_active =
          next[i] < tiles_of_[i].size() && tiles_of_[i][next[i]].tile == tile.tile;
      blocks_.push_back(is_active ? tiles_of_[i][next[i]++].active_blocks : std::uint8_t{0});
      tile.active_blocks |= blocks_.back();
    }
    tiles_.push_back(tile);
  }
}

void TileStream::begin() {
  if (next_tile_ == tiles_.size()) load_next_chunk();
}

std::optional<TileWork> TileStream::next() {
  while (next_tile_ == tiles_.size() && load_next_chunk()) {
  }
  if (next_tile_ == tiles_.size()) return std::nullopt;
  return tiles_[next_tile_++];
}

bool BatchPlanner::next(TileBatch& batch) {
  batch.tiles.clear();
  batch.tiles_of.assign(stream_.isovalues(), {});
  batch.bricks.clear();
  FlatMap<char> needed(max_tiles_);
  std::vector<Int3> of_tile;
  while (batch.tiles.size() < max_tiles_) {
    if (!held_) held_ = stream_.next();
    if (!held_) break;
    if (whole_tiles_) held_->active_blocks = 0xff;
    of_tile.clear();
    append_needed_bricks(lattice_, *held_, reach_, of_tile);
    const auto key = [&](Int3 b) {
      return static_cast<std::uint64_t>(linear_index(b, lattice_.bricks()));
    };
    std::erase_if(of_tile, [&](Int3 b) { return needed.contains(key(b)); });
    if (!batch.tiles.empty() && batch.bricks.size() + of_tile.size() > max_bricks_) break;
    for (const Int3 b : of_tile) {
      needed.insert(key(b));
      batch.bricks.push_back(b);
    }
    batch.tiles.push_back(*held_);
    for (std::size_t i = 0; i < batch.tiles_of.size(); ++i)
      if (const std::uint8_t blocks = stream_.blocks_of_each()[i])
        batch.tiles_of[i].push_back({held_->tile, blocks});
    held_.reset();
  }
  return !batch.tiles.empty();
}

}  // namespace isobrick

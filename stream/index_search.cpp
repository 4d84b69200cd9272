#include "stream/index_search.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include <isobrick/error.h>
#include "core/morton.h"
#include "index/span_index.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kBrickBlocks = IndexLayout::kBrick / kBlockEdge;
constexpr Index kBrickTiles = IndexLayout::kBrick / kTileEdge;
/// Parts that are searched at a time have at most about so many bytes.
constexpr std::uint64_t kWaveBytes = std::uint64_t{64} << 20;

/// More parts of a file than these are not read one by one.
constexpr std::size_t kPartsOneByOne = 16;

constexpr std::uint64_t block_bit(Int3 b) {
  return std::uint64_t{1} << (b.x + kBrickBlocks * (b.y + kBrickBlocks * b.z));
}

/// The bits [first, first + count) of `words`, count <= 64.
std::uint64_t bits_at(std::span<const std::uint64_t> words, std::uint64_t first, int count) {
  const auto word = static_cast<std::size_t>(first >> 6);
  const int shift = static_cast<int>(first & 63);
  std::uint64_t bits = words[word] >> shift;
  if (shift + count > 64) bits |= words[word + 1] << (64 - shift);
  return count == 64 ? bits : bits & ((std::uint64_t{1} << count) - 1);
}

/// The blocks of a tile of an index brick, as TileWork has them.
std::uint8_t blocks_of_tile(std::uint64_t blocks, Int3 tile) {
  unsigned bits = 0;
  for (int i = 0; i < 8; ++i)
    if (blocks & block_bit(tile * 2 + Int3{i & 1, i >> 1 & 1, i >> 2})) bits |= 1u << i;
  return static_cast<std::uint8_t>(bits);
}

std::vector<std::uint64_t> marks(const IndexView& index, double isovalue) {
  std::vector<std::uint64_t> words(mask_words(index.items()));
  mark(index, isovalue, words);
  return words;
}

}  // namespace

IndexView open_index_part(std::span<const std::byte> bytes, IndexKind kind, ScalarType type,
                          Int3 grid) {
  const IndexView index = open_index(bytes);
  if (index.kind() != kind || index.type() != type || index.grid() != grid)
    throw DamageError("index: not of the kind, type and extents that it must have");
  return index;
}

std::string index_brick_name(int level, std::string_view kind, Int3 brick) {
  return fmt::format("level {}, {} index, index brick ({}, {}, {})", level, kind, brick.x, brick.y,
                     brick.z);
}

std::uint64_t marked_blocks(std::span<const std::uint64_t> words, Int3 grid, Index leaf) {
  const Index per_block = kBlockEdge / leaf;
  const std::uint64_t of_block = (std::uint64_t{1} << per_block) - 1;
  std::uint64_t blocks = 0, first = 0;
  for (Index z = 0; z < grid.z; ++z)
    for (Index y = 0; y < grid.y; ++y, first += static_cast<std::uint64_t>(grid.x)) {
      std::uint64_t row = bits_at(words, first, static_cast<int>(grid.x));
      for (Index x = 0; row; ++x, row >>= per_block)
        if (row & of_block) blocks |= block_bit({x, y / per_block, z / per_block});
    }
  return blocks;
}

IndexSearch::IndexSearch(const StoreReader& store, int level, IndexKind kind)
    : level_(level), kind_(kind), index_(store, level, std::string(name_of(kind))) {}

std::uint64_t IndexSearch::part_bytes(const IndexLayout& layout) {
  const auto edge = static_cast<std::uint64_t>(IndexLayout::kBrick / layout.leaf);
  // The largest are quadtrees whose items all differ, encoded and decoded, and a bit an item.
  return edge * edge * edge * 2 * (20 + 6 * size_of(layout.type)) + 4096;
}

std::uint64_t IndexSearch::wave(const IndexLayout& layout, int threads) {
  const auto most = static_cast<std::uint64_t>(std::max(threads, 1)) * 16;
  return std::clamp<std::uint64_t>(kWaveBytes / part_bytes(layout), 1, most);
}

std::vector<Int3> IndexSearch::active_bricks(const IndexChunk& chunk, Int3 c, Box3 tiles,
                                             double isovalue) const {
  const IndexLayout& layout = index_.layout();
  const Box3 box = layout.bricks_of_chunk(c);
  std::vector<std::byte> bytes;
  if (!chunk.read(IndexLayout::kDirectory, bytes))
    throw DamageError(fmt::format("level {}, {} index: '{}' has no directory", level_,
                                  name_of(kind_), chunk.name()));
  std::vector<Int3> bricks;
  try {
    const auto words = marks(open_index_part(bytes, kind_, layout.type, box.extent()), isovalue);
    for_each_morton(box.extent(), [&](Int3 p) {
      const auto i = static_cast<std::size_t>(linear_index(p, box.extent()));
      const Int3 b = box.lo + p;
      const Box3 of_brick{b * kBrickTiles, (b + Int3{1, 1, 1}) * kBrickTiles};
      if ((words[i / 64] >> (i % 64) & 1) && !intersect(of_brick, tiles).empty())
        bricks.push_back(b);
    });
  } catch (const DamageError& e) {
    throw DamageError(
        fmt::format("level {}: {}: {}", level_, chunk.where(IndexLayout::kDirectory), e.what()));
  }
  return bricks;
}

std::uint64_t IndexSearch::active_blocks(const IndexChunk& chunk, Int3 brick,
                                         double isovalue) const {
  const IndexLayout& layout = index_.layout();
  const std::size_t part = layout.part_of_brick(brick);
  const Int3 grid = layout.leaves_of_brick(brick);
  std::vector<std::byte> bytes;
  try {
    if (!chunk.read(part, bytes))
      throw DamageError(
          fmt::format("'{}' has no part for it, but by its directory the "
                      "isovalue is in its range",
                      chunk.name()));
  } catch (const DamageError& e) {
    throw DamageError(index_brick_name(level_, name_of(kind_), brick) + ": " + e.what());
  }
  try {
    const IndexView index = open_index_part(bytes, kind_, layout.type, grid);
    return with_cell_less_blocks(marked_blocks(marks(index, isovalue), grid, layout.leaf), brick);
  } catch (const DamageError& e) {
    throw DamageError(index_brick_name(level_, name_of(kind_), brick) + ": " + chunk.where(part) +
                      ": " + e.what());
  }
}

// Where an axis has 16·k + 1 samples the last of them makes a block without
// cells, so there is no item for it. Its samples are the last of the block before,
// and who extracts wants to know of a block whether its samples are all on one side.
std::uint64_t IndexSearch::with_cell_less_blocks(std::uint64_t blocks, Int3 brick) const {
  const Int3 cells = index_.layout().cells();
  for (int axis = 0; axis < 3; ++axis) {
    const Index last = cells[axis] / kBlockEdge, local = last - brick[axis] * kBrickBlocks;
    if (cells[axis] % kBlockEdge != 0 || local < 1 || local >= kBrickBlocks) continue;
    for_each_point({{0, 0, 0}, {kBrickBlocks, kBrickBlocks, kBrickBlocks}}, [&](Int3 b) {
      if (b[axis] != local - 1 || !(blocks & block_bit(b))) return;
      ++b[axis];
      blocks |= block_bit(b);
    });
  }
  return blocks;
}

void IndexSearch::append_tiles(Int3 c, Box3 box, std::span<const double> isovalues,
                               std::span<std::vector<TileWork>> tiles) {
  for (std::size_t i = 0; i < isovalues.size(); ++i)
    append_tiles_if_few(c, box, isovalues[i], 1, tiles[i]);
}

bool IndexSearch::append_tiles_if_few(Int3 c, Box3 box, double isovalue, double few,
                                      std::vector<TileWork>& tiles) {
  const Int3 chunks = index_.layout().chunks();
  // The last samples of a volume may make range chunks without cells.
  if (c.x >= chunks.x || c.y >= chunks.y || c.z >= chunks.z) return true;
  IndexChunk chunk = index_.open(c);
  const std::vector<Int3> bricks = active_bricks(chunk, c, box, isovalue);
  const auto all = static_cast<double>(index_.layout().parts_of_chunk(c) - 1);
  const bool is_few = static_cast<double>(bricks.size()) <= few * all;
  if (is_few) {
    if (bricks.size() > kPartsOneByOne) chunk.read_whole();
    append_tiles_of(chunk, bricks, box, isovalue, tiles);
  }
  bytes_read_ += chunk.bytes_read();
  return is_few;
}

/// Searches the parts of active index bricks, which are in Morton order.
void IndexSearch::append_tiles_of(const IndexChunk& chunk, const std::vector<Int3>& bricks,
                                  Box3 box, double isovalue, std::vector<TileWork>& tiles) const {
  std::vector<std::uint64_t> blocks(bricks.size());
  const auto wave = static_cast<std::size_t>(
      IndexSearch::wave(index_.layout(), tbb::this_task_arena::max_concurrency()));
  for (std::size_t first = 0; first < bricks.size(); first += wave)
    tbb::parallel_for(first, std::min(first + wave, bricks.size()), [&](std::size_t i) {
      blocks[i] = active_blocks(chunk, bricks[i], isovalue);
    });
  for (std::size_t i = 0; i < bricks.size(); ++i)
    for_each_morton({kBrickTiles, kBrickTiles, kBrickTiles}, [&](Int3 t) {
      const TileWork work{.tile = bricks[i] * kBrickTiles + t,
                          .active_blocks = blocks_of_tile(blocks[i], t)};
      if (work.active_blocks != 0 && box.contains(work.tile)) tiles.push_back(work);
    });
}

}  // namespace isobrick

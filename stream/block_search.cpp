#include "stream/block_search.h"

#include <tbb/parallel_for.h>

#include "index/active_tiles.h"
#include "stream/index_search.h"

namespace isobrick::inline v0 {
namespace {

/// Blocks along an edge of the cubes that are searched at the same time.
constexpr Index kCubeEdge = 16;
static_assert(StoreReader::kRangeChunk % kCubeEdge == 0);

/// The tiles of a chunk with a block that the isovalue touches, in Morton order.
void append_active_tiles(const RangeTable& table, double isovalue, std::vector<TileWork>& tiles) {
  std::vector<Box3> cubes;
  const Int3 edge{kCubeEdge, kCubeEdge, kCubeEdge};
  for_each_morton(ceil_div(table.box.extent(), edge), [&](Int3 c) {
    const Int3 lo = table.box.lo + c * kCubeEdge;
    cubes.push_back(intersect({lo, lo + edge}, table.box));
  });
  const Int3 extent = table.box.extent();
  const auto is_active = [&](Int3 block) {
    return table.ranges[static_cast<std::size_t>(linear_index(block - table.box.lo, extent))]
        .stabbed_by(isovalue);
  };
  std::vector<std::vector<TileWork>> found(cubes.size());
  tbb::parallel_for(std::size_t{0}, cubes.size(),
                    [&](std::size_t i) { append_tiles_where(cubes[i], is_active, found[i]); });
  for (const std::vector<TileWork>& some : found)
    tiles.insert(tiles.end(), some.begin(), some.end());
}

/// Looks at the range of every block.
class RangeSearch final : public BlockSearch {
 public:
  RangeSearch(const StoreReader& store, int level, const std::optional<CapSearch>& cap = {})
      : store_(store), level_(level), cap_(cap) {}

  void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                    std::span<std::vector<TileWork>> tiles) override {
    const RangeTable table = read(chunk);
    for (std::size_t i = 0; i < isovalues.size(); ++i)
      append_tiles(table, box, isovalues[i], tiles[i], cap_);
  }
  std::uint64_t range_bytes() const override { return bytes_read_; }

  /// The ranges of a chunk's blocks.
  RangeTable read(Int3 chunk) {
    RangeTable table = read_chunk_ranges(store_, level_, chunk);
    bytes_read_ += table.bytes_read;
    return table;
  }
  static void append_tiles(const RangeTable& table, Box3 box, double isovalue,
                           std::vector<TileWork>& tiles, const std::optional<CapSearch>& cap = {}) {
    if (cap)
      append_capped_tiles<double>(table.box, table.ranges, isovalue, *cap, tiles);
    else
      append_active_tiles(table, isovalue, tiles);
    std::erase_if(tiles, [&](const TileWork& work) { return !box.contains(work.tile); });
  }

 private:
  const StoreReader& store_;
  int level_;
  std::optional<CapSearch> cap_;
  std::uint64_t bytes_read_ = 0;
};

/// First finds in the index how much of a chunk is active. Where that is more than
/// kFew, looking at all ranges is faster: docs/experiments/2026-11-index.md has the figures.
class SparseSearch final : public BlockSearch {
 public:
  SparseSearch(const StoreReader& store, int level, IndexKind kind)
      : ranges_(store, level), index_(store, level, kind) {}

  void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                    std::span<std::vector<TileWork>> tiles) override {
    std::optional<RangeTable> table;  // read once, for all isovalues that need it
    for (std::size_t i = 0; i < isovalues.size(); ++i) {
      if (index_.append_tiles_if_few(chunk, box, isovalues[i], kFew, tiles[i])) continue;
      if (!table) table = ranges_.read(chunk);
      RangeSearch::append_tiles(*table, box, isovalues[i], tiles[i]);
    }
  }
  std::uint64_t range_bytes() const override { return ranges_.range_bytes(); }
  std::uint64_t index_bytes() const override { return index_.index_bytes(); }

 private:
  static constexpr double kFew = 1.0 / 8;
  RangeSearch ranges_;
  IndexSearch index_;
};

}  // namespace

RangeTable read_chunk_ranges(const StoreReader& store, int level, Int3 chunk) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  constexpr Int3 edge{StoreReader::kRangeChunk, StoreReader::kRangeChunk, StoreReader::kRangeChunk};
  return store.block_ranges(level, intersect({chunk * edge, (chunk + Int3{1, 1, 1}) * edge},
                                             {{0, 0, 0}, lattice.blocks()}));
}

std::unique_ptr<BlockSearch> make_block_search(const StoreReader& store, int level, SearchMethod by,
                                               const std::optional<CapSearch>& cap) {
  if (!by.kind || cap) return std::make_unique<RangeSearch>(store, level, cap);
  if (by.only_if_few) return std::make_unique<SparseSearch>(store, level, *by.kind);
  return std::make_unique<IndexSearch>(store, level, *by.kind);
}

std::uint64_t block_search_bytes(const StoreReader& store, int level, SearchMethod by,
                                 int threads) {
  if (!by.kind) return 0;
  const StoredIndex index(store, level, std::string(name_of(*by.kind)));
  return IndexSearch::wave(index.layout(), threads) * IndexSearch::part_bytes(index.layout());
}

}  // namespace isobrick

#include "isobrick/stream/block_search.h"

#include "isobrick/index/active_tiles.h"
#include "isobrick/stream/index_search.h"

namespace isobrick {
namespace {

/// Looks at the range of every block.
class RangeSearch final : public BlockSearch {
 public:
  RangeSearch(const StoreReader& store, int level) : store_(store), level_(level) {}

  void append_tiles(Int3 chunk, Box3 box, double isovalue, std::vector<TileWork>& tiles) override {
    const Lattice& lattice = store_.info().levels[static_cast<std::size_t>(level_)].lattice;
    constexpr Int3 edge{StoreReader::kRangeChunk, StoreReader::kRangeChunk,
                        StoreReader::kRangeChunk};
    const std::uint64_t before = store_.bytes_read();
    const RangeTable table = store_.block_ranges(
        level_,
        intersect({chunk * edge, (chunk + Int3{1, 1, 1}) * edge}, {{0, 0, 0}, lattice.blocks()}));
    bytes_read_ += store_.bytes_read() - before;
    append_active_tiles<double>(table.box, table.ranges, isovalue, tiles);
    std::erase_if(tiles, [&](const TileWork& work) { return !box.contains(work.tile); });
  }
  std::uint64_t bytes_read() const override { return bytes_read_; }

 private:
  const StoreReader& store_;
  int level_;
  std::uint64_t bytes_read_ = 0;
};

}  // namespace

std::unique_ptr<BlockSearch> make_block_search(const StoreReader& store, int level,
                                               std::optional<IndexKind> kind) {
  if (!kind) return std::make_unique<RangeSearch>(store, level);
  return std::make_unique<IndexSearch>(store, level, *kind);
}

std::uint64_t block_search_bytes(const StoreReader& store, int level, std::optional<IndexKind> kind,
                                 int threads) {
  if (!kind) return 0;
  const StoredIndex index(store, level, std::string(name_of(*kind)));
  return IndexSearch::wave(index.layout(), threads) * IndexSearch::part_bytes(index.layout());
}

}  // namespace isobrick

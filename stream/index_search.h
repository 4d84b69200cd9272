#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bricks/stored_index.h"
#include "index/index_format.h"
#include "stream/block_search.h"

namespace isobrick::inline v0 {

/// A decoded part of an index chunk: checked, and the index of `grid` that its
/// layout requires. Throws DamageError with what is wrong, not where.
/// The view lasts as long as the bytes.
IndexView open_index_part(std::span<const std::byte> bytes, IndexKind kind, ScalarType type,
                          Int3 grid);

/// How messages name the part of an index brick.
std::string index_brick_name(int level, std::string_view kind, Int3 brick);

/// The blocks of 16³ cells of an index brick (bit x + 4·y + 16·z) that hold an
/// item with its bit set in `words`; the items are blocks of leaf³ cells, C order
/// [z, y, x] of `grid`.
std::uint64_t marked_blocks(std::span<const std::uint64_t> words, Int3 grid, Index leaf);

/// Searches a stored index: the directory of each chunk for its active index
/// bricks, then the parts of these.
class IndexSearch final : public BlockSearch {
 public:
  IndexSearch(const StoreReader& store, int level, IndexKind kind);

  void append_tiles(Int3 chunk, Box3 box, std::span<const double> isovalues,
                    std::span<std::vector<TileWork>> tiles) override;
  std::uint64_t index_bytes() const override { return bytes_read_; }

  /// The same for one isovalue, unless more than `few` of the chunk's index bricks are active, as a
  /// fraction: then nothing is appended and it returns false.
  bool append_tiles_if_few(Int3 chunk, Box3 box, double isovalue, double few,
                           std::vector<TileWork>& tiles);

  /// The most bytes that searching one part takes, and how many parts are
  /// searched at a time.
  static std::uint64_t part_bytes(const IndexLayout& layout);
  static std::uint64_t wave(const IndexLayout& layout, int threads);

 private:
  std::vector<Int3> active_bricks(const IndexChunk& chunk, Int3 c, Box3 tiles,
                                  double isovalue) const;
  void append_tiles_of(const IndexChunk& chunk, const std::vector<Int3>& bricks, Box3 box,
                       double isovalue, std::vector<TileWork>& tiles) const;
  std::uint64_t active_blocks(const IndexChunk& chunk, Int3 brick, double isovalue) const;
  std::uint64_t with_cell_less_blocks(std::uint64_t blocks, Int3 brick) const;

  int level_;
  IndexKind kind_;
  StoredIndex index_;
  std::uint64_t bytes_read_ = 0;
};

}  // namespace isobrick

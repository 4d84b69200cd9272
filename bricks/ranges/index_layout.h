#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <isobrick/lattice.h>

namespace isobrick::inline v0 {

/// What is stored of one kind of index of one level, and how it is cut.
///
/// An index divides the level's cells into index bricks of 64³, which lie on the
/// volume's lattice whatever the store's bricks are; an item is a block of leaf³
/// cells. 8³ index bricks share a file, the index chunk: the cells of one chunk
/// of block ranges.
struct IndexLayout {
  static constexpr Index kBrick = 64;  ///< cells along each edge of an index brick
  static constexpr Index kChunk = 8;   ///< index bricks along each edge of an index chunk

  std::string kind;  ///< "octree", …; what it means is not the store's concern
  Index leaf = 16;   ///< 1, 2, 4, 8 or 16; of label lists 32
  ScalarType type = ScalarType::u8;
  Int3 extent;                    ///< samples of the level
  std::optional<int> zstd_level;  ///< nothing: parts are stored as they are
  /// LevelInfo::block_ranges_crc32c of the level that it was made of: that of no other store.
  std::uint32_t ranges_crc32c = 0;

  friend bool operator==(const IndexLayout&, const IndexLayout&) = default;

  Int3 cells() const { return max(extent - Int3{1, 1, 1}, {0, 0, 0}); }
  Int3 bricks() const { return ceil_div(cells(), {kBrick, kBrick, kBrick}); }
  Int3 chunks() const { return ceil_div(bricks(), {kChunk, kChunk, kChunk}); }
  /// The index bricks of chunk `c`, cut at the border.
  Box3 bricks_of_chunk(Int3 c) const {
    return intersect({c * kChunk, (c + Int3{1, 1, 1}) * kChunk}, {{0, 0, 0}, bricks()});
  }
  /// The grid of items of index brick `b`, cut at the border.
  Int3 leaves_of_brick(Int3 b) const {
    return ceil_div(min(cells() - b * kBrick, {kBrick, kBrick, kBrick}), {leaf, leaf, leaf});
  }

  /// A chunk's parts: its directory, then its bricks, C order [z, y, x].
  static constexpr std::size_t kDirectory = 0;
  std::size_t parts_of_chunk(Int3 c) const {
    return 1 + static_cast<std::size_t>(volume(bricks_of_chunk(c).extent()));
  }
  std::size_t part_of_brick(Int3 b) const {
    const Box3 box = bricks_of_chunk({b.x / kChunk, b.y / kChunk, b.z / kChunk});
    return 1 + static_cast<std::size_t>(linear_index(b - box.lo, box.extent()));
  }
};

/// The index of label lists, whose items are tiles.
inline constexpr const char* kLabelIndex = "labels";
inline constexpr Index kLabelLeaf = 32;

/// True for the leaves that an index can have.
constexpr bool is_index_leaf(Index leaf) {
  return leaf == 1 || leaf == 2 || leaf == 4 || leaf == 8 || leaf == 16;
}

/// The text of index.json, and the checksum in it.
std::string to_json(const IndexLayout& layout);
std::uint32_t checksum_of(const IndexLayout& layout);

/// Reads index.json; `where` names the file. DamageError for what is broken,
/// Error for a version that this program does not know.
IndexLayout parse_index_layout(std::string_view text, const std::string& where);

}  // namespace isobrick

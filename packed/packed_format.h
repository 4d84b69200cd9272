#pragma once

#include <cstddef>
#include <cstdint>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

// The numbers of the packed codec; docs/reference/packed_codec.md specifies every byte.

namespace isobrick::inline v0::packed {

inline constexpr std::uint8_t kVersion = 1;
/// A brick is packed in blocks of 16³ samples, each of which can be unpacked alone.
inline constexpr int kEdge = 16;
inline constexpr int kSlice = kEdge * kEdge;  ///< samples
inline constexpr int kBlock = kEdge * kSlice;
/// Eight rows of a block are a group: bit y of a byte belongs to row y.
inline constexpr int kRows = 8;
inline constexpr int kGroups = kBlock / (kEdge * kRows);
/// One bit of all codes of a group.
inline constexpr int kPlaneBytes = kEdge;
inline constexpr std::size_t kMaxPalette = 256;

/// The axes along which a block holds differences, as bits.
enum Axes : std::uint8_t { along_x = 1, along_y = 2, along_z = 4, all_axes = 7 };

/// How a brick begins; `ends` of its blocks, a palette and the blocks follow.
struct BrickHeader {
  std::uint8_t version = kVersion;
  std::uint8_t code_bytes = 0;  ///< 1, 2, 4 or 8; 1 with a palette; 0: plain samples follow
  std::uint16_t palette = 0;    ///< entries; 0: none
};
static_assert(sizeof(BrickHeader) == 4);

/// Blocks of a brick along x, y, z.
constexpr Int3 blocks_of(Int3 brick) { return ceil_div(brick, {kEdge, kEdge, kEdge}); }

/// Bytes of the header and of the blocks' ends.
constexpr std::size_t table_bytes(Int3 brick) {
  return sizeof(BrickHeader) +
         static_cast<std::size_t>(volume(blocks_of(brick))) * sizeof(std::uint32_t);
}

/// The most bytes that a block takes: all bits of its codes, and two masks a group.
constexpr std::size_t max_block_bytes(std::size_t code_bytes) {
  return code_bytes + 1 + sizeof(std::uint32_t) + (kBlock + 2 * kGroups) * code_bytes;
}

/// The most bytes that a brick takes: those of plain samples.
constexpr std::size_t max_packed_bytes(Int3 brick, std::size_t sample_bytes) {
  return sizeof(BrickHeader) + static_cast<std::size_t>(volume(brick)) * sample_bytes;
}

}  // namespace isobrick::inline v0::packed

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace isobrick::inline v0::packed {

/// What a block's samples are.
struct BlockKind {
  std::size_t code_bytes = 1;  ///< 1, 2, 4 or 8
  bool floating = false;       ///< are IEEE 754 numbers, and packed as ordered integers
};

/// Packs 16³ samples, x fastest, into `out`, which has room for max_block_bytes(); returns how many
/// bytes it took. The bytes are the same on every processor. Thread-safe.
std::size_t pack_block(BlockKind kind, const void* samples, std::uint8_t* out);

/// Unpacks into rows of 16 samples that lie `row` samples apart, and slices `slice` apart. False
/// for bytes that no block is packed to; some samples may be written then. Thread-safe.
bool unpack_block(BlockKind kind, std::span<const std::uint8_t> block, void* samples,
                  std::ptrdiff_t row, std::ptrdiff_t slice);

}  // namespace isobrick::inline v0::packed

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "packed/packed_format.h"

namespace isobrick::inline v0::packed {

/// Where the parts of a packed brick lie.
class BrickLayout {
 public:
  /// Throws DamageError for bytes that no brick of this kind is packed to. The blocks' own bytes
  /// are not looked at. `packed` must outlive it.
  BrickLayout(ScalarType type, Int3 extent, std::span<const std::byte> packed);

  /// Whether plain samples follow: then there are no blocks.
  bool is_plain() const { return is_plain_; }
  std::span<const std::byte> plain() const { return blocks_; }
  /// Values of the palette; 0: the brick has none.
  std::size_t entries() const { return entries_; }
  std::span<const std::byte> palette() const { return palette_; }
  /// The bytes of a block, x fastest.
  std::span<const std::uint8_t> block(std::size_t number) const;

 private:
  bool is_plain_ = false;
  std::size_t entries_ = 0;
  const std::byte* ends_;
  std::span<const std::byte> palette_, blocks_;
};

/// What is wrong with a brick whose block unpack_block() refuses.
std::string damaged_block(std::size_t number);

}  // namespace isobrick::inline v0::packed

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/tile.h"
#include "gpu/stream/stream_layout.h"

namespace isobrick::inline v0::gpu {

/// A brick that a launch takes along as a whole.
struct UploadedBrick {
  const std::byte* from;
};

/// Where a launch finds the samples of its tiles.
struct BrickTable {
  std::span<BrickBox> boxes;           ///< one a tile
  std::span<std::uint64_t> addresses;  ///< as many a tile as there can be, x fastest; 0: absent
};

/// How a launch reads its bricks.
struct BrickUse {
  std::vector<UploadedBrick> sent;  ///< in the order of their places on the device
  std::uint64_t read_bytes = 0;     ///< of samples that the device reads where they lie
};

/// Fills the table for these tiles. A brick of which they need a good part is sent, as long
/// as one of `places` on the device is left, and the table names that place, counted from
/// `device`; of the others the device reads what it needs where they lie.
BrickUse use_bricks(const Lattice& lattice, Index reach, std::span<const TileWork> tiles,
                    const BrickLookup& bricks, std::size_t places, const std::byte* device,
                    const BrickTable& table);

/// Fills the table for the 32³ samples of these tiles, with the places that `bricks` has.
void locate_bricks(const Lattice& lattice, std::span<const Int3> tiles, const BrickLookup& bricks,
                   const BrickTable& table);

}  // namespace isobrick::gpu

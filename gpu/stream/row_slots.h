#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include <isobrick/vec.h>
#include "core/flat_map.h"
#include "gpu/tile/tile_params.h"

namespace isobrick::inline v0::gpu {

/// Which row table on the device belongs to which tile, as the BoundaryMap of the CPU:
/// tiles come in Morton order, and a tile's last user is its neighbour at (+1, +1, +1).
/// Bookkeeping only; not thread-safe.
class RowSlots {
 public:
  /// `tiles` is the grid: where a neighbour is beyond it, the last user is nearer.
  RowSlots(std::uint32_t slots, Int3 tiles);

  /// A slot for a tile that is about to be extracted, of the launch that is being
  /// put together. Throws Error when none is left.
  std::uint32_t add(Int3 tile);
  /// A tile's slot as TileLinks holds it, or kNone.
  std::uint32_t find(Int3 tile) const;
  /// Those of the tiles around one; kNone for the tile itself and those beyond the grid.
  void find_around(Int3 tile, TileNeighbours& around) const;
  /// Ends a launch whose last tile is `last`. Appends the slots that no later tile will
  /// ask for; they go back with recycle(), when the launch need not be repeated any more.
  void end_launch(Int3 last, std::vector<std::uint32_t>& unused);
  void recycle(std::vector<std::uint32_t>& slots);

 private:
  struct Entry {
    std::uint32_t slot = kNone, launch = 0;
  };
  /// Of 4×4×4 tiles: a tile's neighbours are looked up, and most lie in its own cube.
  struct Cube {
    std::array<Entry, 64> entries;
    int used = 0;
  };
  struct Expiry {
    std::uint64_t last_user, tile;  ///< codes
  };
  const Cube* cube_of(Int3 tile) const;
  void drop(Int3 tile, std::vector<std::uint32_t>& unused);

  FlatMap<std::unique_ptr<Cube>> cubes_;
  std::uint64_t added_key_ = 0;
  Cube* added_cube_ = nullptr;  ///< the one that was added to last, by that key
  /// By cubes of tiles that the last askers lie in: neighbours are added after one another.
  std::map<std::uint64_t, std::vector<Expiry>> expiries_;
  std::map<std::uint64_t, std::vector<Expiry>>::iterator added_last_ = expiries_.end();
  std::vector<std::uint32_t> free_;
  Int3 last_tile_;
  std::uint32_t launch_ = 0;
};

}  // namespace isobrick::gpu

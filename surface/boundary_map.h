#pragma once

#include <cstdint>
#include <memory>
#include <queue>
#include <unordered_map>
#include <vector>

#include "surface/tile_state.h"

namespace isobrick::inline v0 {

/// The boundaries of finished tiles that tiles still to come will ask for.
/// Tiles come in Morton order, so a tile's last asker is its neighbour at
/// (+1, +1, +1), or what is nearest to that in the grid: memory follows the surface between
/// finished and unfinished.
class BoundaryMap {
 public:
  /// `tiles` is the grid.
  explicit BoundaryMap(Int3 tiles) : last_tile_(tiles - Int3{1, 1, 1}) {}

  /// A boundary to fill for a tile about to be extracted.
  TileBoundary* add(Int3 tile);
  /// The boundary of a tile, or null when no surface passes it.
  const TileBoundary* find(Int3 tile) const;
  /// No tile before `next` will be extracted any more.
  void forget_before(Int3 next);
  void clear();
  std::size_t size() const { return map_.size(); }
  /// The most boundaries that a map of such a grid holds after forget_before(next), with that of
  /// `next`.
  static std::uint64_t max_size(Int3 tiles);

 private:
  struct Expiry {
    std::uint64_t last_asker, key;
    bool operator>(const Expiry& other) const { return last_asker > other.last_asker; }
  };
  Int3 last_tile_;
  std::unordered_map<std::uint64_t, std::unique_ptr<TileBoundary>> map_;
  std::priority_queue<Expiry, std::vector<Expiry>, std::greater<>> expiries_;
  std::vector<std::unique_ptr<TileBoundary>> spare_;
};

/// Copies the tile's own vertices on its upper planes to its boundary.
void publish_boundary(TileState& tile);

/// Completes the tile's rows: own numbers count from the tile's base, rows and edges
/// on its lower planes the numbers that the tiles before gave them.
void adopt_boundaries(TileState& tile, const BoundaryMap& map);

}  // namespace isobrick

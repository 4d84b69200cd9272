#pragma once

#include <cstdint>
#include <vector>

#include "core/morton.h"
#include "core/tile.h"
#include "core/tile_range.h"
#include "pipeline/extract/extract_plan.h"

namespace isobrick::inline v0 {

/// How the tiles of a mesh are divided, in their order, into parts of about as many active
/// blocks.
struct PartPlans {
  struct Plan {
    std::uint64_t begin = ~std::uint64_t{0};  ///< morton_encode() of its first tile
    std::uint64_t active_blocks = 0;          ///< of its tiles
  };
  std::vector<Plan> parts;
  Box3 bounds;                ///< of the active cells of all parts
  Int3 grid;                  ///< tiles of the volume along x, y and z
  bool looks_around = false;  ///< TileRange::looks_around

  std::uint32_t count() const { return static_cast<std::uint32_t>(parts.size()); }
  /// Of part `number`, from 1.
  TileRange tiles(std::uint32_t number) const;
  std::uint64_t active_blocks(std::uint32_t number) const {
    return parts[number - 1].active_blocks;
  }
  /// The part that a tile belongs to.
  std::uint32_t part_of(std::uint64_t code) const;
  /// Of `all` blocks, how many lie before the end of the first `number` parts.
  static std::uint64_t blocks_before(std::uint64_t all, std::uint64_t number, std::uint64_t count) {
    return all / count * number + all % count * number / count;
  }
};

/// Divides the tiles that `visit` passes to its argument, with a number of blocks each: so many
/// parts, `plans.parts`, of about as many blocks. `visit(f)` is called twice and calls
/// f(TileWork, blocks) in the order of the tiles.
template <class Visit>
void divide_tiles(PartPlans& plans, std::uint32_t count, Visit&& visit);

/// Plans so many parts. Found from the ranges of the blocks alone, so every task that asks gets the
/// same.
PartPlans plan_parts(const StoreReader& store, const ExtractRequest& request, int level,
                     std::uint32_t count);

template <class Visit>
void divide_tiles(PartPlans& plans, std::uint32_t count, Visit&& visit) {
  plans.parts.assign(count, {});
  plans.parts.front().begin = 0;
  std::uint64_t all = 0;
  visit([&](const TileWork&, std::uint64_t blocks) { all += blocks; });
  std::uint32_t begun = 1;
  std::uint64_t before = 0;
  visit([&](const TileWork& work, std::uint64_t blocks) {
    while (begun < count && before >= PartPlans::blocks_before(all, begun, count))
      plans.parts[begun++].begin = morton_encode(work.tile);
    plans.parts[begun - 1].active_blocks += blocks;
    before += blocks;
  });
}

}  // namespace isobrick

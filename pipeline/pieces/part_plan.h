#pragma once

#include <cstdint>
#include <vector>

#include "core/tile_range.h"
#include "pipeline/extract/extract_plan.h"

namespace isobrick::inline v0 {

/// How the tiles of a surface are divided, in their order, into parts of about as many active
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
};

/// Plans so many parts. Found from the ranges of the blocks alone, so every task that asks gets the
/// same.
PartPlans plan_parts(const StoreReader& store, const ExtractRequest& request, int level,
                     std::uint32_t count);

}  // namespace isobrick

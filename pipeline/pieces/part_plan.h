#pragma once

#include <cstdint>

#include <isobrick/part.h>
#include "core/tile_range.h"
#include "pipeline/extract/extract_plan.h"

namespace isobrick::inline v0 {

/// The tiles of a part.
struct PartPlan {
  TileRange tiles;
  std::uint64_t active_blocks = 0;  ///< of these tiles
  Box3 bounds;                      ///< of the active cells of all parts
};

/// Divides the tiles of a surface, in their order, into parts of about as many active blocks. Found
/// from the ranges of the blocks alone, so every task that asks gets the same.
PartPlan plan_part(const StoreReader& store, const ExtractRequest& request, int level, Part part);

}  // namespace isobrick

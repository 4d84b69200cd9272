#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "pipeline/extract/extract_pass.h"

namespace isobrick::inline v0 {

/// What came of a resident pass.
struct ResidentPassResult {
  std::size_t made = 0;              ///< surfaces, the first ones
  std::uint64_t progress_ahead = 0;  ///< reported for surfaces that were not made
};

/// Loads the tiles that any of the surfaces touches to a device and makes the surfaces from them
/// (can_be_resident()). Calls `begin` with a surface's number when its mesh is made; then the mesh
/// goes to the sink, which is finished. Several sinks are written at a time, as the plan has room
/// for. The first surface that the budgets have no room for, or that the device fails at, ends the
/// pass: it and those after it have not begun. `tiles` are those of all surfaces; `other_bytes` as
/// for plan_memory().
ResidentPassResult run_resident_pass(const StoreReader& store, const ExtractOptions& options,
                                     const PassSurfaces& surfaces, TileStream tiles,
                                     std::uint64_t other_bytes,
                                     const std::function<void(std::size_t)>& begin,
                                     Progress& progress);

}  // namespace isobrick

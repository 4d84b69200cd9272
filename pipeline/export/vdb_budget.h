#pragma once

#include <cstdint>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// What OpenVDB and the libraries that it needs take once they are loaded, beside kProgramBytes.
inline constexpr std::uint64_t kVdbLibraryBytes = std::uint64_t{32} << 20;

/// The most that a grid over `extent` voxels with so many leaves takes; `value_bytes` each.
std::uint64_t vdb_grid_bytes(Int3 extent, std::uint64_t leaves, std::uint64_t value_bytes);

/// Throws UsageError for a budget that is too small for a grid, naming one that is enough.
/// `grid` bytes of that are the grid's, the rest for other things.
[[noreturn]] void refuse_vdb_budget(std::uint64_t budget, std::uint64_t enough, std::uint64_t grid);

}  // namespace isobrick

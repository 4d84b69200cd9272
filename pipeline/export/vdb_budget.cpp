#include "pipeline/export/vdb_budget.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>
#include "pipeline/program_memory.h"

namespace isobrick::inline v0 {
namespace {

/// Samples along an edge of a tree's nodes: leaves, and the two levels above.
constexpr Int3 kLeaf{8, 8, 8}, kLower{128, 128, 128}, kUpper{4096, 4096, 4096};
/// Bytes of the nodes above leaves (children and masks), and of a leaf beside its values.
constexpr std::uint64_t kLowerBytes = 36 << 10, kUpperBytes = 288 << 10, kLeafBytes = 256;

}  // namespace

std::uint64_t vdb_grid_bytes(Int3 extent, std::uint64_t leaves, std::uint64_t value_bytes) {
  const auto nodes = [&](Int3 edge) {
    return static_cast<std::uint64_t>(volume(ceil_div(extent, edge)));
  };
  const std::uint64_t lowers = nodes(kLower), uppers = nodes(kUpper);
  return std::min(leaves, nodes(kLeaf)) * (512 * value_bytes + kLeafBytes) + lowers * kLowerBytes +
         uppers * kUpperBytes;
}

void refuse_vdb_budget(std::uint64_t budget, std::uint64_t enough, std::uint64_t grid) {
  throw UsageError(fmt::format(
      "a memory budget of {:.1f} MiB is too small: --memory {}M is enough, {:.1f} MiB of it for "
      "the "
      "grid, which OpenVDB holds whole, and {} for the program and its libraries; or export a "
      "region or a coarser level",
      in_mib(budget), mib_above(enough), in_mib(grid), (kProgramBytes + kVdbLibraryBytes) >> 20));
}

}  // namespace isobrick

#include "tools/store_region.h"

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::tools {

Box3 store_region(const StoreReader& store, int level, const RegionArguments& region) {
  const auto& levels = store.info().levels;
  if (level < 0 || static_cast<std::size_t>(level) >= levels.size())
    throw UsageError(fmt::format("'{}' has no level {}; its levels are 0 to {}", store.info().name,
                                 level, levels.size() - 1));
  const LevelInfo& info = levels[static_cast<std::size_t>(level)];
  const Box3 box = resolve_region(region.roi.value_or(RoiText{}), info.lattice.extent);
  if (!region.region) return box;
  const Box3 both =
      intersect(box, covering_samples(*region.region, info.transform, info.lattice.extent));
  if (both.empty()) throw UsageError("--roi and --region have no sample in common");
  return both;
}

}  // namespace isobrick::tools

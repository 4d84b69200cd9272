#include "tools/store_region.h"

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::tools {

Box3 store_region(const StoreReader& store, int level, const std::optional<RoiText>& roi) {
  const auto& levels = store.info().levels;
  if (level < 0 || static_cast<std::size_t>(level) >= levels.size())
    throw UsageError(fmt::format("'{}' has no level {}; its levels are 0 to {}",
                                 store.info().path.string(), level, levels.size() - 1));
  const Int3 extent = levels[static_cast<std::size_t>(level)].lattice.extent;
  return resolve_roi(roi.value_or(RoiText{}), extent);
}

}  // namespace isobrick::tools

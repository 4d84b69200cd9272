#pragma once

#include <vector>

#include <isobrick/isovalue.h>
#include <isobrick/store_reader.h>
#include "tools/console.h"

namespace isobrick::tools {

/// The isovalues that requests mean in a store; reads its histogram if any needs it. Those
/// that come to the same value are one. Writes a remark where a far value makes it coarse.
std::vector<double> resolve_isovalues(const std::vector<IsovalueRequest>& requests,
                                      const StoreReader& store, Console& console);

/// An isovalue to try, as suggest_isovalue(); nullopt where no surface exists.
std::optional<SuggestedIsovalue> suggest_isovalue_of(const StoreReader& store, Console& console);

}  // namespace isobrick::tools

#pragma once

#include <vector>

#include <isobrick/isovalue.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick::tools {

/// The isovalues that requests mean in a store; reads its histogram if any needs it. Those
/// that come to the same value are one.
std::vector<double> resolve_isovalues(const std::vector<IsovalueRequest>& requests,
                                      const StoreReader& store, Progress& progress);

/// An isovalue to try, as suggest_isovalue(); nullopt where no surface exists.
std::optional<SuggestedIsovalue> suggest_isovalue_of(const StoreReader& store, Progress& progress);

}  // namespace isobrick::tools

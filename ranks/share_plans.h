#pragma once

#include <functional>

#include "pipeline/pieces/part_plan.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Collective: the plans that `make` gives on rank 0. So one rank reads the ranges of the whole
/// volume, and every other those of its parts.
PartPlans share_plans(Ranks& ranks, const std::function<PartPlans()>& make);

}  // namespace isobrick

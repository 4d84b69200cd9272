#pragma once

#include <string>

#include <isobrick/range.h>
#include <isobrick/store_reader.h>
#include "pipeline/value_text.h"

namespace isobrick::tools {

/// Range of a level's samples, from the bricks' ranges: one layer of them at a time. Empty where
/// there are none or only NaN. Throws what StoreReader::brick_ranges() does.
ValueRange<double> value_range(const StoreReader& store, int level);

/// "the samples of level 0 lie within 0 and 255", for an isovalue without a surface.
std::string range_text(const StoreReader& store, int level);

/// Why an isovalue has no surface; empty where samples lie on both its sides, or nobody knows
/// because the level has no ranges.
std::string why_out_of_range(const StoreReader& store, int level, double isovalue);

}  // namespace isobrick::tools

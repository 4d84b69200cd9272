#pragma once

#include <string>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/range.h"

namespace isobrick::tools {

/// Range of a level's samples, from the bricks' ranges: one layer of them at a time. Empty where
/// there are none or only NaN. Throws what StoreReader::brick_ranges() does.
ValueRange<double> value_range(const StoreReader& store, int level);

/// The fewest digits that read back as this sample of a volume.
std::string sample_text(double value, ScalarType type);

}  // namespace isobrick::tools

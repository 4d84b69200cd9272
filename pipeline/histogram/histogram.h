#pragma once

#include <optional>

#include <isobrick/histogram.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/stored_histogram.h"

namespace isobrick::inline v0 {

/// The counts of level 0 that a store keeps; nullopt if it keeps none. Throws DamageError where
/// they are damaged.
std::optional<SampleCounts> stored_counts(const StoreReader& store);

/// The histogram of counts of samples of a type.
Histogram histogram_of(SampleCounts&& counts, ScalarType type);

}  // namespace isobrick

#pragma once

#include <memory>
#include <optional>

#include <isobrick/volume_source.h>
#include "core/wide_type.h"

namespace isobrick::inline v0 {

/// Samples of u64 or i64, which `stored` hands out as if they were f64, as the f64 that they are.
/// A source without such a type stays as it is. read() throws Error naming the file and the row of
/// the first integer that no f64 is.
std::unique_ptr<VolumeSource> widen_source(std::unique_ptr<VolumeSource> stored,
                                           std::optional<WideType> type);

}  // namespace isobrick

#pragma once

#include <string>

#include <isobrick/range.h>
#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// The fewest digits that read back as this sample of a volume.
std::string sample_text(double value, ScalarType type);

/// "the samples of level 0 lie within 0 and 255", of a level's range.
std::string range_text(const ValueRange<double>& range, ScalarType type, int level);

/// Why an isovalue has no surface on a level whose samples have this range; empty where samples lie
/// on both its sides.
std::string why_out_of_range(const ValueRange<double>& range, ScalarType type, int level,
                             double isovalue);

}  // namespace isobrick

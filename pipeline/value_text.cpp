#include "pipeline/value_text.h"

#include <fmt/format.h>

namespace isobrick::inline v0 {

std::string sample_text(double value, ScalarType type) {
  return type == ScalarType::f32 ? fmt::format("{}", static_cast<float>(value))
                                 : fmt::format("{}", value);
}

std::string range_text(const ValueRange<double>& range, ScalarType type, int level) {
  if (range.empty()) return "no sample is a number";
  return fmt::format("the samples of level {} lie within {} and {}", level,
                     sample_text(range.lo, type), sample_text(range.hi, type));
}

std::string why_out_of_range(const ValueRange<double>& range, ScalarType type, int level,
                             double isovalue) {
  if (range.stabbed_by(isovalue)) return {};
  return fmt::format("isovalue {}: the surface is empty; {}", isovalue,
                     range_text(range, type, level));
}

}  // namespace isobrick

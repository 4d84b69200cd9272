#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/label.h>

namespace isobrick::inline v0 {

/// What an image says of one of its labels.
struct LabelProperties {
  Label label = 0;        ///< the samples' value
  std::string name = {};  ///< for people; empty: none
  /// Red, green, blue and alpha in sRGB.
  std::optional<std::array<std::uint8_t, 4>> colour = {};

  friend bool operator==(const LabelProperties&, const LabelProperties&) = default;
};

/// What a label image says of its labels, in ascending order; of some, or of none.
using LabelTable = std::vector<LabelProperties>;

}  // namespace isobrick

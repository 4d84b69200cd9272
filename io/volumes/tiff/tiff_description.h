#pragma once

#include <string>

#include <isobrick/vec.h>

namespace isobrick {

/// What ImageJ or OME say, in the description of the first page, of all pages.
struct TiffDescription {
  Index channels = 1, slices = 0, times = 1;  ///< slices 0: all pages that there are
  std::string order = "CZT";  ///< of the pages: which of channel, z and time goes fastest, …
  Vec3d spacing{0, 0, 0};     ///< 0: not said
  std::string unit;
  bool image_j = false;  ///< pages may lie behind the first without headers
};

/// Parses the description of a first page, whatever it is. Throws UsageError for
/// numbers that make no sense.
TiffDescription parse_tiff_description(const std::string& path, const std::string& text);

}  // namespace isobrick

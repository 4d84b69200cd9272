#pragma once

#include <string>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The description of all pages that ImageJ or OME write into the first page.
struct TiffDescription {
  Index channels = 1, slices = 0, times = 1;  ///< slices 0: all pages that there are
  std::string order = "CZT";  ///< of the pages: which of channel, z and time goes fastest, …
  Vec3d spacing{0, 0, 0};     ///< 0: not given
  std::string unit;
  bool image_j = false;  ///< pages may lie behind the first without headers
};

/// Parses the description of a first page, whatever it is. Throws UsageError for
/// numbers that make no sense.
TiffDescription parse_tiff_description(const std::string& path, const std::string& text);

}  // namespace isobrick

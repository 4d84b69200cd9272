#pragma once

#include "tests/viewer/render/png_picture.h"

namespace isobrick::test {

/// Perceived difference of two pictures: ΔE of CIELAB (1976), after a binomial filter over 5 × 5
/// pixels in linear light, which is about the eye's resolution at arm's length. 1 is just
/// noticeable side by side.
struct PictureDifference {
  double mean = 0;   ///< over all pixels
  double share = 0;  ///< part of the pixels that differ by more than kNoticed

  static constexpr double kNoticed = 4;
  /// Allowed difference between drivers: the smoothing of edges, the rounding of colours. A
  /// different surface, colour or light exceeds it.
  static constexpr double kMaxMean = 0.25, kMaxShare = 0.004;
  bool tolerable() const { return mean <= kMaxMean && share <= kMaxShare; }
};

/// The pictures must have the same size.
PictureDifference difference(const PngPicture& a, const PngPicture& b);

}  // namespace isobrick::test

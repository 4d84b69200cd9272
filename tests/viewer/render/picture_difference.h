#pragma once

#include "tests/viewer/render/png_picture.h"

namespace isobrick::test {

/// How far apart two pictures look: ΔE of CIELAB (1976) after both were blurred by a
/// binomial filter over 5 × 5 pixels in linear light, about what the eye resolves at
/// arm's length. 1 is just noticeable side by side.
struct PictureDifference {
  double mean = 0;   ///< over all pixels
  double share = 0;  ///< part of the pixels that differ by more than kNoticed

  static constexpr double kNoticed = 4;
  /// What drivers may differ by: how edges are smoothed and where the last bit of a
  /// colour falls. Not whether a surface, a colour or a light is another.
  static constexpr double kMaxMean = 0.25, kMaxShare = 0.004;
  bool tolerable() const { return mean <= kMaxMean && share <= kMaxShare; }
};

/// Of two pictures of the same size.
PictureDifference difference(const PngPicture& a, const PngPicture& b);

}  // namespace isobrick::test

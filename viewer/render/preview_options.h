#pragma once

#include <isobrick/vec.h>

namespace isobrick {

/// Limits of a picture's width and height, in pixels.
inline constexpr int kMinPictureEdge = 16, kMaxPictureEdge = 16384;

/// Options of PreviewSink.
struct PreviewOptions {
  int width = 1280, height = 960;      ///< pixels, kMinPictureEdge … kMaxPictureEdge
  Vec3f colour{0.87f, 0.80f, 0.70f};   ///< of the surface, sRGB in [0, 1]
  Vec3d towards_eye{0.55, -1.0, 0.5};  ///< from the volume's centre, world space
  Vec3d up{0, 0, 1};
};

}  // namespace isobrick

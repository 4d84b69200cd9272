#pragma once

#include <isobrick/vec.h>
#include "viewer/render/camera_request.h"

namespace isobrick::inline v0 {

/// Limits of a picture's width and height, in pixels.
inline constexpr int kMinPictureEdge = 16, kMaxPictureEdge = 16384;

/// Options of PreviewSink.
struct PreviewOptions {
  int width = 1280, height = 960;     ///< pixels, kMinPictureEdge … kMaxPictureEdge
  Vec3f colour{0.87f, 0.80f, 0.70f};  ///< of the surface, sRGB in [0, 1]
  CameraRequest camera;
};

}  // namespace isobrick

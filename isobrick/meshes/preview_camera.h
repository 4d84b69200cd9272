#pragma once

#include "isobrick/core/vec.h"

namespace isobrick {

/// A perspective camera that sees all of a box. Camera space: x to the right,
/// y down, z away from the eye, lengths in half diagonals of the box.
class PreviewCamera {
 public:
  /// `towards_eye`: from the box's centre; `up`: world direction that shows upwards.
  PreviewCamera(Vec3d world_lo, Vec3d world_hi, Vec3d towards_eye, Vec3d up, int width, int height);

  Vec3f rotate(Vec3f v) const {
    return {right_.x * v.x + right_.y * v.y + right_.z * v.z,
            down_.x * v.x + down_.y * v.y + down_.z * v.z,
            ahead_.x * v.x + ahead_.y * v.y + ahead_.z * v.z};
  }

  /// Pixel coordinates (pixel centres at .5) and the reciprocal of the depth,
  /// which is linear in the picture. It is 0 for what lies behind the eye.
  Vec3f project(Vec3f world) const {
    // The centre first: world coordinates may be large against the box.
    const Vec3f c = rotate((world - centre_) * scale_);
    const float depth = c.z + distance_;
    if (!(depth > 1e-3f)) return {0, 0, 0};
    const float w = 1 / depth;
    return {half_.x + c.x * w * focal_, half_.y + c.y * w * focal_, w};
  }

  /// Length, in camera space, of a pixel at depth 1.
  float pixel() const { return 1 / focal_; }

 private:
  Vec3f centre_, right_, down_, ahead_;
  Vec3f half_;  ///< of the picture
  float scale_ = 1, distance_ = 1, focal_ = 1;
};

}  // namespace isobrick

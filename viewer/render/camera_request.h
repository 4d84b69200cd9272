#pragma once

#include <optional>
#include <string_view>

#include <isobrick/vec.h>
#include "viewer/render/camera.h"

namespace isobrick::inline v0 {

/// A requested camera, before the scene is known.
struct CameraRequest {
  double azimuth = 30;    ///< degrees around `up`; 0 looks along +y if up is z, 90 from +x
  double elevation = 20;  ///< degrees above the plane that `up` is normal to
  double roll = 0;        ///< degrees, clockwise on the picture
  double zoom = 1;        ///< 2: twice as large as the fitting size
  double field_of_view = 30;
  bool orthographic = false;
  Vec3d up{0, 0, 1};
  std::optional<Vec3d> from;         ///< direction towards the eye; replaces the two angles
  std::optional<Vec3d> eye, target;  ///< world positions; default of target: the scene's centre
};

/// Parses "azimuth=30,elevation=20,roll=0,zoom=1.2,fov=40,orthographic,up=0:0:-1", "from=1:1:0.5",
/// "eye=10:0:5,target=0:0:0"; each part is optional. Throws UsageError.
CameraRequest parse_camera(std::string_view text);

/// Makes the camera for a scene with the bounds lo, hi and a picture of width / height `aspect`. If
/// `eye` is set, zoom narrows the field of view. Throws UsageError for an eye at the target.
Camera make_camera(const CameraRequest& request, Vec3d lo, Vec3d hi, double aspect);

}  // namespace isobrick

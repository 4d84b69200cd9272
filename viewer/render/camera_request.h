#pragma once

#include <optional>
#include <string_view>

#include <isobrick/vec.h>
#include "viewer/render/camera.h"

namespace isobrick {

/// A camera as it is asked for, before the scene is known.
struct CameraRequest {
  double azimuth = 30;    ///< degrees around `up`; 0 looks along +y if up is z, 90 from +x
  double elevation = 20;  ///< degrees above the plane that `up` is normal to
  double roll = 0;        ///< degrees that the picture is turned clockwise
  double zoom = 1;        ///< 2: twice as large as what fits
  double field_of_view = 30;
  bool orthographic = false;
  Vec3d up{0, 0, 1};
  std::optional<Vec3d> from;         ///< towards the eye, instead of the two angles
  std::optional<Vec3d> eye, target;  ///< places in the world; target: else the scene's centre
};

/// "azimuth=30,elevation=20,roll=0,zoom=1.2,fov=40,orthographic,up=0:0:-1",
/// "from=1:1:0.5", "eye=10:0:5,target=0:0:0"; every part may be left out. Throws UsageError.
CameraRequest parse_camera(std::string_view text);

/// The camera for a scene and a picture of width / height `aspect`. With an eye the
/// zoom narrows the field of view. Throws UsageError for an eye at the target.
Camera make_camera(const CameraRequest& request, Vec3d lo, Vec3d hi, double aspect);

}  // namespace isobrick

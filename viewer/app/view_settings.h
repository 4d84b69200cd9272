#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "viewer/app/navigation.h"
#include "viewer/render/camera.h"
#include "viewer/render/renderer.h"
#include "viewer/render/surface_colour.h"

namespace isobrick::inline v0 {

/// One isosurface.
struct SurfaceSettings {
  double isovalue = std::numeric_limits<double>::quiet_NaN();  ///< NaN: for choose_values()
  Vec3f colour{0.87f, 0.80f, 0.70f};                           ///< sRGB in [0, 1]
  float opacity = 1;
  bool shown = true;
  friend bool operator==(const SurfaceSettings&, const SurfaceSettings&) = default;
};

/// A clip plane across an axis of the volume.
struct AxisClipSettings {
  bool on = false;
  float position = 0.5f;  ///< 0: the volume's first sample, 1: its last
  bool above = true;      ///< clips what lies above `position`; else what lies below
  friend bool operator==(const AxisClipSettings&, const AxisClipSettings&) = default;
};

/// A clip plane at any angle.
struct ClipPlaneSettings {
  bool on = true;
  HalfSpace kept;
  friend bool operator==(const ClipPlaneSettings&, const ClipPlaneSettings&) = default;
};

/// A slice across an axis of the volume.
struct SliceSettings {
  bool shown = false;
  float position = 0.5f;
  friend bool operator==(const SliceSettings&, const SliceSettings&) = default;
};

/// All settings of a picture of a store. Besides them a picture depends on the camera, the store,
/// and the data that is loaded.
struct ViewSettings {
  std::vector<SurfaceSettings> surfaces;
  std::array<AxisClipSettings, 3> axis_clips;  ///< across x, y, z
  std::vector<ClipPlaneSettings> planes;       ///< kMaxClipPlanes at most
  std::array<SliceSettings, 3> slices;         ///< across x, y, z
  /// Samples that slices show black and white; unless lo < hi, choose_values() sets them.
  float window_lo = 0, window_hi = 0;
  bool region_on = false;
  Vec3f region_lo{0, 0, 0}, region_hi{1, 1, 1};  ///< clip box in fractions of the volume
  bool occlusion = true, edges = false, multisample = true;
  bool box = true, axes = true, scale_bar = true;
  float pixel_error = 1.5f;  ///< maximum length of a cell on the picture, in pixels
  int finest_level = 0;      ///< stored level; finer ones are not shown
  Vec3f background_top{0.95f, 0.96f, 0.97f}, background_bottom{0.74f, 0.77f, 0.80f};
  friend bool operator==(const ViewSettings&, const ViewSettings&) = default;
};

inline constexpr std::size_t kMaxSurfaces = 16;
inline constexpr float kMinPixelError = 0.1f, kMaxPixelError = 1000;

// JSON for bookmarks. Reading throws Error for missing or invalid fields.
nlohmann::ordered_json to_json(const ViewSettings& settings);
ViewSettings view_settings_from(const nlohmann::ordered_json& json);
nlohmann::ordered_json to_json(const Camera& camera);
Camera camera_from(const nlohmann::ordered_json& json);

}  // namespace isobrick

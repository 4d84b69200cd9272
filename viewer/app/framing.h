#pragma once

#include "viewer/app/scene_renderer.h"
#include "viewer/render/camera_request.h"

namespace isobrick::inline v0 {

/// Moves the camera and its target so that a box of a store fills a picture of width / height
/// `aspect` up to a margin. The direction stays.
void frame(Camera& camera, const SceneRenderer& scene_renderer, const WorldBox& box, double aspect);

/// Makes the requested camera. Without an eye it frames SceneRenderer::shown_bounds(), not the
/// whole volume.
Camera make_camera(const CameraRequest& request, const SceneRenderer& scene_renderer,
                   const ViewSettings& settings, double aspect);

}  // namespace isobrick

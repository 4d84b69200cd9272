#pragma once

#include "viewer/app/scene_renderer.h"
#include "viewer/render/camera_request.h"

namespace isobrick {

/// Moves the camera back or ahead, and its target, so that a box of a store fills a picture of
/// width / height `aspect` but for a margin.
void frame(Camera& camera, const SceneRenderer& scene_renderer, const WorldBox& box, double aspect);

/// The camera that is asked for. One without an eye of its own frames what the settings show, not
/// the volume around it: SceneRenderer::shown_bounds().
Camera make_camera(const CameraRequest& request, const SceneRenderer& scene_renderer,
                   const ViewSettings& settings, double aspect);

}  // namespace isobrick

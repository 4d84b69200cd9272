#include "viewer/app/framing.h"

namespace isobrick::inline v0 {
namespace {

/// Sets the camera's depth range to the whole volume, its box and slices.
void see_all(Camera& camera, const SceneRenderer& scene_renderer) {
  const WorldBox all = scene_renderer.bounds();
  camera.scene = ball_around(all.lo, all.hi);
}

}  // namespace

void frame(Camera& camera, const SceneRenderer& scene_renderer, const WorldBox& box,
           double aspect) {
  camera.fit(box.lo, box.hi, aspect);
  see_all(camera, scene_renderer);
}

Camera make_camera(const CameraRequest& request, const SceneRenderer& scene_renderer,
                   const ViewSettings& settings, double aspect) {
  const WorldBox box =
      request.eye ? scene_renderer.bounds() : scene_renderer.shown_bounds(settings);
  Camera camera = make_camera(request, box.lo, box.hi, aspect);
  see_all(camera, scene_renderer);
  return camera;
}

}  // namespace isobrick

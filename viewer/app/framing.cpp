#include "viewer/app/framing.h"

namespace isobrick {
namespace {

/// All of the volume may be drawn, its box and slices too, whatever is framed.
void see_all(Camera& camera, const SceneRenderer& picture) {
  const WorldBox all = picture.bounds();
  camera.scene = ball_around(all.lo, all.hi);
}

}  // namespace

void frame(Camera& camera, const SceneRenderer& picture, const WorldBox& box, double aspect) {
  camera.fit(box.lo, box.hi, aspect);
  see_all(camera, picture);
}

Camera make_camera(const CameraRequest& request, const SceneRenderer& picture,
                   const ViewSettings& settings, double aspect) {
  const WorldBox box = request.eye ? picture.bounds() : picture.shown_bounds(settings);
  Camera camera = make_camera(request, box.lo, box.hi, aspect);
  see_all(camera, picture);
  return camera;
}

}  // namespace isobrick

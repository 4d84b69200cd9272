#pragma once

#include <optional>

#include "viewer/app/viewer_state.h"

namespace isobrick::inline v0 {

/// The point that the picture shows at a pixel, rows from the top; nullopt on the background.
std::optional<PickedPoint> pick_point(SceneRenderer& scene_renderer, int x, int y);

/// Draws the points and the line of a measurement over the picture, with Dear ImGui.
void draw_measure(const ViewerState& state, const PictureArea& area);

}  // namespace isobrick

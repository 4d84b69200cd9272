#pragma once

#include "viewer/app/view_settings.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/drawable.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

/// Draws what a picture shows beside surfaces and slices: boxes with a cross where `shown` (null:
/// nothing) is damaged, and the volume's box, axes and scale bar where settings want them. `last`:
/// the last sample of level 0.
void draw_markers(Renderer& renderer, const ViewSettings& settings, const NodeGrid& grid,
                  Vec3d last, const Drawable* shown);

}  // namespace isobrick

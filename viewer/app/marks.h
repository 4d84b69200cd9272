#pragma once

#include "isobrick/render/renderer.h"
#include "isobrick/viewer/drawable.h"
#include "isobrick/viewer/node_grid.h"
#include "isobrick/window/view_settings.h"

namespace isobrick {

/// Draws what a picture shows beside surfaces and slices: boxes with a cross where `shown` (null:
/// nothing) is damaged, and the volume's box, axes and scale bar where settings want them. `last`:
/// the last sample of level 0.
void draw_marks(Renderer& renderer, const ViewSettings& settings, const NodeGrid& grid, Vec3d last,
                const Drawable* shown);

}  // namespace isobrick

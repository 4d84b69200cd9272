#pragma once

#include "viewer/app/view_settings.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/drawable.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// Draws boxes with a cross around damaged nodes of `shown` (null: none). Draws the volume's box,
/// axes and scale bar if the settings have them. `last`: the last sample of level 0.
void draw_markers(Renderer& renderer, const ViewSettings& settings, const NodeGrid& grid,
                  Vec3d last, const Drawable* shown);

}  // namespace isobrick

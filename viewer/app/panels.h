#pragma once

#include <string>

#include "viewer/app/viewer_state.h"

namespace isobrick {

/// The height of the font, and the panel's width at first, where the display is not scaled.
inline constexpr float kFontPixels = 13, kPanelWidth = 390;

/// Pixels of a display that is not scaled, in those of this one.
float scaled(float pixels);

/// Draws all panels into the current frame of Dear ImGui and does to `state` what its
/// user does to them.
void draw_panels(ViewerState& state);

/// Keys and mouse, while state.help says so.
void draw_help(ViewerState& state);

/// A line in the middle of the window, in place of a picture.
void draw_notice(const std::string& text);

/// Isovalue over the histogram: a drag moves the selected surface, the pointer tells how
/// much surface there is.
void draw_isovalue_slider(ViewerState& state, float width, float height);

/// What is cut away: across axes, by planes at any angle, outside of a region.
void draw_clip_panel(ViewerState& state);

/// Which volume of an image with channels or times is shown; nothing of one without.
void draw_volumes_panel(ViewerState& state);

/// What makes meshes.
void draw_backend_panel(ViewerState& state);

/// Which index finds the nodes that isovalues cross, and what that takes.
void draw_search_panel(ViewerState& state);

}  // namespace isobrick

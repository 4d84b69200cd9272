#pragma once

#include <string>

#include "viewer/app/viewer_state.h"

namespace isobrick::inline v0 {

/// Height of the font and initial width of the panel, on a display without scaling.
inline constexpr float kFontPixels = 13, kPanelWidth = 390;

/// Converts pixels of a display without scaling to pixels of this one.
float scaled(float pixels);

/// Draws all panels into the current frame of Dear ImGui and applies the user's changes to `state`.
void draw_panels(ViewerState& state);

/// Draws the help on keys and mouse, if state.help.
void draw_help(ViewerState& state);

/// Draws a line of text in the middle of the window, instead of a picture.
void draw_notice(const std::string& text);

/// Draws the histogram with the isovalues. Dragging moves the selected surface; the tooltip shows
/// how large the surface is.
void draw_isovalue_slider(ViewerState& state, float width, float height);

/// Draws the clipping settings: across axes, by planes at any angle, by a region.
void draw_clip_panel(ViewerState& state);

/// Draws the choice of a volume, for images with channels or times only.
void draw_volumes_panel(ViewerState& state);

/// Draws the choice of the backend that makes meshes.
void draw_backend_panel(ViewerState& state);

/// Draws the choice of the index over active nodes, and its costs.
void draw_search_panel(ViewerState& state);

}  // namespace isobrick

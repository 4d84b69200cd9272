#pragma once

#include <imgui.h>

// Wrappers of functions that differ between versions of Dear ImGui, for tests.

namespace isobrick::test {

/// Whether the window's font has a glyph for a character.
inline bool has_glyph(ImWchar character) {
  ImFont* font = ImGui::GetIO().Fonts->Fonts[0];
#if IMGUI_VERSION_NUM >= 19200
  return font->IsGlyphInFont(character);
#else
  return font->FindGlyphNoFallback(character) != nullptr;
#endif
}

/// The font's size.
inline float font_pixels() {
  const ImFont* font = ImGui::GetIO().Fonts->Fonts[0];
#if IMGUI_VERSION_NUM >= 19200
  return font->LegacySize;
#else
  return font->FontSize;
#endif
}

/// Scales the text.
inline void scale_font(float scale) {
#if IMGUI_VERSION_NUM >= 19200
  ImGui::GetStyle().FontScaleMain = scale;
#else
  ImGui::GetIO().FontGlobalScale = scale;
#endif
}

inline void hold_key(ImGuiKey key, bool down) {
  ImGuiIO& io = ImGui::GetIO();
#if IMGUI_VERSION_NUM >= 18700
  io.AddKeyEvent(key, down);
#else
  io.KeyMap[key] = 300 + key;
  io.KeysDown[300 + key] = down;
#endif
}

inline void hold_control(bool down) {
#if IMGUI_VERSION_NUM >= 18900
  hold_key(ImGuiMod_Ctrl, down);
#elif IMGUI_VERSION_NUM >= 18700
  hold_key(ImGuiKey_ModCtrl, down);
#else
  ImGui::GetIO().KeyCtrl = down;
#endif
}

}  // namespace isobrick::test

#pragma once

#include <imgui.h>

// What versions of Dear ImGui call by other names, for tests.

namespace isobrick::test {

/// Whether the font of the window has a character of its own.
inline bool has_glyph(ImWchar character) {
  ImFont* font = ImGui::GetIO().Fonts->Fonts[0];
#if IMGUI_VERSION_NUM >= 19200
  return font->IsGlyphInFont(character);
#else
  return font->FindGlyphNoFallback(character) != nullptr;
#endif
}

/// The size that it was loaded in.
inline float font_pixels() {
  const ImFont* font = ImGui::GetIO().Fonts->Fonts[0];
#if IMGUI_VERSION_NUM >= 19200
  return font->LegacySize;
#else
  return font->FontSize;
#endif
}

/// Makes text larger than that.
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

#include <array>

#include <imgui.h>

#include "viewer/app/panels.h"

namespace isobrick::inline v0 {
namespace {

struct HelpLine {
  const char* keys;
  const char* effect;
};

constexpr std::array kLines{
    HelpLine{"left button", "rotate (in fly mode: look around)"},
    HelpLine{"middle button, or shift + left", "pan"},
    HelpLine{"right button, or wheel", "zoom (in fly mode the wheel changes the speed)"},
    HelpLine{"control + left button", "roll"},
    HelpLine{"click", "position, value and normal of the surface"},
    HelpLine{"[ ] or arrow keys", "isovalue of the selected surface; with shift: finer"},
    HelpLine{"Tab", "select the next surface"},
    HelpLine{"R", "frame the surface; with shift: the whole volume"},
    HelpLine{"X Y Z", "look along an axis; with shift: from behind"},
    HelpLine{"P", "perspective or orthographic"},
    HelpLine{"F", "orbit, trackball, fly"},
    HelpLine{"W A S D Q E", "move, in fly mode"},
    HelpLine{"1 2 3", "clip across x, y, z"},
    HelpLine{"M", "measure between two clicks"},
    HelpLine{"O L B", "occlusion, edges, box"},
    HelpLine{"H", "show or hide the panel"},
    HelpLine{"F12", "save the picture as isobrick.png"},
    HelpLine{"F1 or ?", "this help"},
    HelpLine{"Escape", "close this help, cancel a conversion, close the window"},
    HelpLine{"drop a file", "open a store, or convert a volume"},
};

}  // namespace

void draw_help(ViewerState& state) {
  if (!state.help) return;
  const ImVec2 all = ImGui::GetMainViewport()->Size;
  const float left = state.panel_room(all.x);
  ImGui::SetNextWindowPos({(left + all.x) / 2, all.y / 2}, ImGuiCond_Appearing, {0.5f, 0.5f});
  ImGui::SetNextWindowSizeConstraints({0, 0}, {all.x, all.y});
  if (ImGui::Begin("Keys and mouse", &state.help,
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_AlwaysAutoResize |
                       ImGuiWindowFlags_NoSavedSettings) &&
      ImGui::BeginTable("help", 2, ImGuiTableFlags_RowBg | ImGuiTableFlags_SizingFixedFit)) {
    for (const HelpLine& line : kLines) {
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line.keys);
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line.effect);
    }
    ImGui::EndTable();
  }
  ImGui::End();
}

}  // namespace isobrick

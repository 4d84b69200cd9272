#include <imgui.h>

#include <isobrick/error.h>
#include "viewer/app/panels.h"

namespace isobrick::inline v0 {

void draw_backend_panel(ViewerState& state) {
  DeviceMeshes& device = state.scene_renderer->device();
  const char* const names[] = {"auto", "cpu", "cuda"};
  int chosen = static_cast<int>(device.backend());
  ImGui::SetNextItemWidth(scaled(130));
  if (ImGui::Combo("makes meshes", &chosen, names, 3)) {
    try {
      device.use(static_cast<Backend>(chosen));
    } catch (const Error& e) {
      state.show_message(e.what());
    }
  }
  ImGui::TextWrapped("%s", device.describe().c_str());
}

}  // namespace isobrick

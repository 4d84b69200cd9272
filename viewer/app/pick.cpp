#include "viewer/app/pick.h"

#include <fmt/format.h>
#include <imgui.h>

#include "core/length_unit.h"
#include "core/vectors.h"
#include "viewer/app/panels.h"
#include "viewer/scene/probe.h"

namespace isobrick::inline v0 {
namespace {

constexpr ImU32 kInk = IM_COL32(20, 20, 20, 255), kPaper = IM_COL32(255, 230, 90, 255);

}  // namespace

std::optional<PickedPoint> pick_point(SceneRenderer& scene_renderer, int x, int y) {
  const auto hit = scene_renderer.renderer().pick(x, y);
  if (!hit) return std::nullopt;
  PickedPoint point;
  point.world = hit->position;
  point.surface = hit->id;
  const NodeGrid& grid = scene_renderer.scene().tree().grid();
  point.index = to_index_space(grid, hit->position);
  if (const auto field = probe(grid, scene_renderer.scene().stream().bricks(), hit->position)) {
    point.value = field->value;
    point.normal = to_double(field->normal);
  }
  return point;
}

void draw_measure(const ViewerState& state, const PictureArea& area) {
  if (state.measured.empty() || state.scene_renderer == nullptr) return;
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const auto place = [&](Vec3d world) {
    const Vec3d p = state.navigator.camera.project(world, area.width, area.height);
    return ImVec2((static_cast<float>(p.x) + static_cast<float>(area.left)) * size.x /
                      static_cast<float>(area.window_width),
                  static_cast<float>(p.y) * size.y / static_cast<float>(area.height));
  };
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  const ImVec2 first = place(state.measured[0]);
  if (state.measured.size() == 2) {
    const ImVec2 second = place(state.measured[1]);
    draw.AddLine(first, second, kInk, scaled(4));
    draw.AddLine(first, second, kPaper, scaled(2));
    const std::string text =
        fmt::format("{:.6g} {}", length(state.measured[1] - state.measured[0]),
                    unit_symbol(state.scene_renderer->scene().tree().grid().transform().unit));
    const ImVec2 middle((first.x + second.x) / 2 + scaled(8), (first.y + second.y) / 2);
    draw.AddText({middle.x + 1, middle.y + 1}, kInk, text.c_str());
    draw.AddText(middle, kPaper, text.c_str());
  }
  for (const Vec3d& point : state.measured) {
    draw.AddCircleFilled(place(point), scaled(6), kInk);
    draw.AddCircleFilled(place(point), scaled(4), kPaper);
  }
}

}  // namespace isobrick

#include <algorithm>
#include <array>
#include <utility>

#include <imgui.h>

#include "core/vectors.h"
#include "viewer/app/panels.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

void axis_clips(ViewSettings& settings) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    AxisClipSettings& clip = settings.axis_clips[axis];
    ImGui::PushID(kAxes[axis]);
    ImGui::Checkbox(kAxes[axis], &clip.on);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(scaled(150));
    ImGui::SliderFloat("##place", &clip.position, 0, 1, "%.3f", ImGuiSliderFlags_AlwaysClamp);
    ImGui::SameLine();
    if (ImGui::SmallButton(clip.above ? "above" : "below")) clip.above = !clip.above;
    ImGui::PopID();
  }
}

/// The range of HalfSpace::least for planes with this normal that meet the box.
std::pair<double, double> offset_range(const WorldBox& box, Vec3d normal) {
  double lo = 0, hi = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = normal[axis] * box.lo[axis], b = normal[axis] * box.hi[axis];
    lo += std::min(a, b);
    hi += std::max(a, b);
  }
  return {lo, hi};
}

/// Sets a plane's normal and keeps its relative position in the box.
void rotate(HalfSpace& kept, const WorldBox& box, Vec3d normal) {
  const auto [old_lo, old_hi] = offset_range(box, kept.normal);
  const double part = old_hi > old_lo ? (kept.least - old_lo) / (old_hi - old_lo) : 0.5;
  kept.normal = normal;
  const auto [lo, hi] = offset_range(box, normal);
  kept.least = lo + std::clamp(part, 0.0, 1.0) * (hi - lo);
}

/// Returns false if the user removes it.
bool one_plane(ClipPlaneSettings& plane, const WorldBox& box, Vec3d ahead) {
  HalfSpace& kept = plane.kept;
  ImGui::Checkbox("##on", &plane.on);
  ImGui::SameLine();
  const auto [lo, hi] = offset_range(box, kept.normal);
  ImGui::SetNextItemWidth(scaled(150));
  ImGui::SliderScalar("##place", ImGuiDataType_Double, &kept.least, &lo, &hi, "%.4g");
  ImGui::SameLine();
  if (ImGui::SmallButton("Flip")) kept = {kept.normal * -1.0, -kept.least};
  ImGui::SameLine();
  if (ImGui::SmallButton("Face me")) rotate(kept, box, ahead);
  ImGui::SameLine();
  const bool stays = !ImGui::SmallButton("x");
  std::array<double, 3> normal{kept.normal.x, kept.normal.y, kept.normal.z};
  ImGui::SetNextItemWidth(scaled(220));
  if (ImGui::InputScalarN("direction", ImGuiDataType_Double, normal.data(), 3, nullptr, nullptr,
                          "%.3f", ImGuiInputTextFlags_EnterReturnsTrue))
    rotate(kept, box, unit({normal[0], normal[1], normal[2]}, kept.normal));
  return stays;
}

void planes(ViewerState& state) {
  auto& list = state.settings.planes;
  const WorldBox box = state.scene_renderer->bounds();
  const Vec3d ahead = state.navigator.camera.back * -1.0;
  for (std::size_t i = 0; i < list.size();) {
    ImGui::PushID(static_cast<int>(i));
    const bool stays = one_plane(list[i], box, ahead);
    ImGui::PopID();
    if (stays)
      ++i;
    else
      list.erase(list.begin() + static_cast<std::ptrdiff_t>(i));
  }
  if (list.size() < kMaxClipPlanes && ImGui::SmallButton("Add a plane"))
    list.push_back({true, half_space_at((box.lo + box.hi) * 0.5, ahead)});
}

}  // namespace

void draw_clip_panel(ViewerState& state) {
  ViewSettings& settings = state.settings;
  axis_clips(settings);
  planes(state);
  ImGui::Checkbox("Region", &settings.region_on);
  if (!settings.region_on) return;
  ImGui::DragFloatRange2("x##r", &settings.region_lo.x, &settings.region_hi.x, 0.002f, 0, 1, "%.3f",
                         nullptr, ImGuiSliderFlags_AlwaysClamp);
  ImGui::DragFloatRange2("y##r", &settings.region_lo.y, &settings.region_hi.y, 0.002f, 0, 1, "%.3f",
                         nullptr, ImGuiSliderFlags_AlwaysClamp);
  ImGui::DragFloatRange2("z##r", &settings.region_lo.z, &settings.region_hi.z, 0.002f, 0, 1, "%.3f",
                         nullptr, ImGuiSliderFlags_AlwaysClamp);
}

}  // namespace isobrick

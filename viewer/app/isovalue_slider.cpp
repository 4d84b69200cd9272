#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <imgui.h>

#include "viewer/app/panels.h"

namespace isobrick::inline v0 {
namespace {

constexpr ImU32 kBack = IM_COL32(30, 32, 36, 255), kBar = IM_COL32(130, 140, 155, 255),
                kCursor = IM_COL32(255, 255, 255, 120);

struct Axis {
  double lo, hi;
  float left, width;

  float place(double value) const {
    return left + width * static_cast<float>((value - lo) / (hi - lo));
  }
  double value(float x) const {
    return lo + (hi - lo) * std::clamp<double>((x - left) / width, 0, 1);
  }
};

/// Draws bars with the logarithm of the counts as height.
void draw_bars(ImDrawList& draw, const Histogram& h, const Axis& axis, float top, float bottom) {
  std::uint64_t max_count = 1;
  for (const std::uint64_t n : h.counts) max_count = std::max(max_count, n);
  const float full = std::log1p(static_cast<float>(max_count));
  for (std::size_t i = 0; i < h.counts.size(); ++i) {
    if (h.counts[i] == 0) continue;
    const double from = h.lo + static_cast<double>(i) * h.bin_width;
    const float left = axis.place(from), right = axis.place(from + h.bin_width);
    const float height = (bottom - top) * std::log1p(static_cast<float>(h.counts[i])) / full;
    draw.AddRectFilled({left, bottom - height}, {std::max(right, left + 1), bottom}, kBar);
  }
}

ImU32 colour_of(const SurfaceSettings& surface) {
  const auto part = [](float c) { return static_cast<int>(std::clamp(c, 0.f, 1.f) * 255 + 0.5f); };
  return IM_COL32(part(surface.colour.x), part(surface.colour.y), part(surface.colour.z), 255);
}

std::string human_count(double n) {
  if (n >= 1e9) return fmt::format("{:.2f} G", n / 1e9);
  if (n >= 1e6) return fmt::format("{:.1f} M", n / 1e6);
  if (n >= 1e3) return fmt::format("{:.0f} k", n / 1e3);
  return fmt::format("{:.0f}", n);
}

void show_tooltip(const ViewerState& state, double isovalue) {
  const IsovalueCounts& counts = state.isovalue_stats->counts();
  const StreamCounters made = state.scene_renderer->scene().stream().counters();
  ImGui::SetTooltip(
      "%s", fmt::format("{:.6g}\nabout {} triangles\nin {} of {} bricks of level 0", isovalue,
                        human_count(state.isovalue_stats->triangles(isovalue, made)),
                        counts.active_bricks(isovalue), counts.bricks())
                .c_str());
}

}  // namespace

void draw_isovalue_slider(ViewerState& state, float width, float height) {
  const auto range = state.isovalue_stats->counts().range();
  if (!(range.lo < range.hi)) {
    ImGui::TextUnformatted(range.empty() ? "There are no samples but NaN."
                                         : "All samples are equal.");
    return;
  }
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::InvisibleButton("isovalue", {width, height});
  const Axis axis{range.lo, range.hi, corner.x, width};
  const float top = corner.y, bottom = corner.y + height;
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(corner, {corner.x + width, bottom}, kBack);
  if (const auto histogram = state.isovalue_stats->histogram())
    draw_bars(draw, *histogram, axis, top + 2, bottom);
  for (std::size_t i = 0; i < state.settings.surfaces.size(); ++i) {
    const float x = axis.place(state.settings.surfaces[i].isovalue);
    draw.AddLine({x, top}, {x, bottom}, colour_of(state.settings.surfaces[i]),
                 scaled(i == state.selected ? 3.f : 1.5f));
  }
  const float pointer = ImGui::GetIO().MousePos.x;
  if (ImGui::IsItemHovered() || ImGui::IsItemActive()) {
    draw.AddLine({pointer, top}, {pointer, bottom}, kCursor, scaled(1));
    show_tooltip(state, axis.value(pointer));
  }
  if (!ImGui::IsItemActive() || state.settings.surfaces.empty()) return;
  state.settings.surfaces[state.selected].isovalue = axis.value(pointer);
}

}  // namespace isobrick

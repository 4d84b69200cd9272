#include <algorithm>

#include <fmt/format.h>
#include <imgui.h>

#include "core/printable.h"
#include "viewer/app/panels.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxNameLength = 60;  ///< characters of a channel's name
constexpr Index kMaxItems = 1'000'000;

/// The number on the axis, and the channel's name if it has one.
std::string item_text(const ImageVolumes& volumes, bool channel, Index number) {
  const auto i = static_cast<std::size_t>(number);
  if (!channel || i >= volumes.channel_names.size()) return fmt::format("{}", number);
  return fmt::format("{}: {}", number, printable(volumes.channel_names[i], kMaxNameLength));
}

/// Draws the items of an open list; returns the one that was clicked.
std::optional<Index> choose_item(const ImageVolumes& volumes, bool channel, Index count,
                                 Index chosen) {
  std::optional<Index> clicked;
  // Draws only the visible items: there may be very many.
  if (ImGui::IsWindowAppearing())
    ImGui::SetScrollY(static_cast<float>(chosen) * ImGui::GetTextLineHeightWithSpacing());
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(std::min(count, kMaxItems)));
  while (clipper.Step())
    for (Index i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      ImGui::PushID(static_cast<int>(i));
      if (ImGui::Selectable(item_text(volumes, channel, i).c_str(), i == chosen)) clicked = i;
      ImGui::PopID();
    }
  return clicked;
}

void axis_list(ViewerState& state, const VolumeAxis& axis) {
  Selection selection = state.volumes.selection;
  std::optional<Index>& place = place_on(axis, selection);
  const bool channel = &place == &selection.channel;
  const Index shown = place.value_or(0);
  const std::string text = item_text(state.volumes, channel, shown);
  ImGui::SetNextItemWidth(scaled(220));
  if (!ImGui::BeginCombo(channel ? "Channel" : "Time", text.c_str())) return;
  const std::optional<Index> clicked = choose_item(state.volumes, channel, axis.count, shown);
  ImGui::EndCombo();
  if (!clicked || *clicked == shown) return;
  place = clicked;
  state.requests.volume = selection;
}

}  // namespace

void draw_volumes_panel(ViewerState& state) {
  for (const VolumeAxis& axis : state.volumes.axes) axis_list(state, axis);
}

}  // namespace isobrick

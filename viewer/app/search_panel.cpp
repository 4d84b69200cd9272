#include <array>

#include <fmt/format.h>
#include <imgui.h>

#include "viewer/app/panels.h"

namespace isobrick::inline v0 {
namespace {

/// Names of kIndexKinds, in their order.
constexpr std::array<const char*, std::size(kIndexKinds)> kNames{"linear scan", "interval tree",
                                                                 "k-d tree", "quadtree", "octree"};

}  // namespace

void draw_search_panel(ViewerState& state) {
  NodeSearch& search = state.scene_renderer->scene().search();
  const NodeSearch::State now = search.state();
  // A refused index is not in use; but the next store may have room for it.
  int chosen = static_cast<int>(now.refused.empty() ? state.index : now.kind);
  ImGui::SetNextItemWidth(scaled(130));
  if (ImGui::Combo("finds active nodes", &chosen, kNames.data(), static_cast<int>(kNames.size()))) {
    state.index = kIndexKinds[chosen];
    search.use(state.index);
  }
  const std::string line = fmt::format(
      "{} of {} nodes in {:.1f} \u00b5s, {}{}", now.active, now.nodes, now.search_seconds * 1e6,
      size_text(now.bytes),
      now.building ? ", building" : fmt::format(", built in {:.1f} ms", now.build_seconds * 1e3));
  ImGui::TextUnformatted(line.c_str());
  if (!now.refused.empty()) ImGui::TextWrapped("%s", now.refused.c_str());
}

}  // namespace isobrick

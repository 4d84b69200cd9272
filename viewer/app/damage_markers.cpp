#include "viewer/app/damage_markers.h"

#include <vector>

#include "core/length_unit.h"
#include "viewer/app/clip_region.h"

namespace isobrick::inline v0 {
namespace {

constexpr Vec3f kMarkColour{0.85f, 0.1f, 0.1f}, kBoxColour{0.35f, 0.38f, 0.42f};

}  // namespace

void draw_markers(Renderer& renderer, const ViewSettings& settings, const NodeGrid& grid,
                  Vec3d last, const Drawable* shown) {
  const Transform& transform = grid.transform();
  if (shown != nullptr)
    for (const NodeDraw& node : shown->nodes) {
      if (node.mesh->damage.empty()) continue;
      const IndexBox box = grid.box(node.mesh->key);
      const auto c = corners(transform, box.lo, box.hi);
      std::vector<WorldLine> lines = edges(c);
      for (std::size_t i = 0; i < 4; ++i) lines.push_back({c[i], c[7 - i]});  // space diagonals
      renderer.draw_lines(lines, kMarkColour, 2);
    }
  if (settings.box) renderer.draw_lines(edges(corners(transform, {0, 0, 0}, last)), kBoxColour);
  if (settings.axes) renderer.draw_axes();
  if (settings.scale_bar) renderer.draw_scale_bar(unit_symbol(transform.unit));
}

}  // namespace isobrick

#include "pipeline/pieces/part_plan.h"

#include <bit>

#include "core/box_union.h"
#include "core/morton.h"
#include "pipeline/extract/mesh_header.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {
namespace {

/// Calls f(TileWork, number of active blocks) until it returns false. An index might find other
/// tiles, which have no surface: ranges alone divide alike wherever there is one.
template <class F>
void visit_tiles(const StoreReader& store, const ExtractRequest& request, int level, F&& f) {
  TileStream tiles(store, level, {request.surface.isovalue}, request.surface.roi, {},
                   cap_search(request.surface));
  while (const auto work = tiles.next())
    if (!f(*work, static_cast<std::uint64_t>(std::popcount(work->active_blocks)))) return;
}

/// Of `all` blocks, how many lie before the end of the first `number` parts.
std::uint64_t blocks_before(std::uint64_t all, std::uint64_t number, std::uint64_t count) {
  return all / count * number + all % count * number / count;
}

}  // namespace

PartPlan plan_part(const StoreReader& store, const ExtractRequest& request, int level, Part part) {
  std::uint64_t all = 0;
  PartPlan plan;
  visit_tiles(store, request, level, [&](const TileWork& work, std::uint64_t blocks) {
    all += blocks;
    for_each_active_block(work, request.surface.roi,
                          [&](Box3 cells) { plan.bounds = unite(plan.bounds, cells); });
    return true;
  });
  plan.tiles.grid = request.level->lattice.tiles();
  plan.tiles.looks_around = request.surface.drop_degenerate || request.surface.cap;
  const std::uint64_t first = blocks_before(all, part.number - 1, part.count);
  const std::uint64_t last = blocks_before(all, part.number, part.count);
  bool has_begun = part.number == 1;
  if (!has_begun) plan.tiles.begin = ~std::uint64_t{0};
  std::uint64_t before = 0;
  visit_tiles(store, request, level, [&](const TileWork& work, std::uint64_t blocks) {
    if (!has_begun && before >= first) {
      has_begun = true;
      plan.tiles.begin = morton_encode(work.tile);
    }
    if (part.number < part.count && before >= last) {
      plan.tiles.end = morton_encode(work.tile);
      return false;
    }
    if (has_begun) plan.active_blocks += blocks;
    before += blocks;
    return true;
  });
  return plan;
}

}  // namespace isobrick

#include "pipeline/pieces/part_plan.h"

#include <algorithm>
#include <bit>

#include "core/box_union.h"
#include "core/morton.h"
#include "pipeline/extract/mesh_header.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {
namespace {

/// Calls f(TileWork, number of active blocks). An index might find other tiles, which have no
/// surface: ranges alone divide alike wherever there is one.
template <class F>
void visit_tiles(const StoreReader& store, const ExtractRequest& request, int level, F&& f) {
  TileStream tiles(store, level, {request.surface.isovalue}, request.surface.roi, {},
                   cap_search(request.surface));
  while (const auto work = tiles.next())
    f(*work, static_cast<std::uint64_t>(std::popcount(work->active_blocks)));
}

}  // namespace

TileRange PartPlans::tiles(std::uint32_t number) const {
  return {.begin = parts[number - 1].begin,
          .end = number < parts.size() ? parts[number].begin : ~std::uint64_t{0},
          .looks_around = looks_around,
          .grid = grid};
}

std::uint32_t PartPlans::part_of(std::uint64_t code) const {
  const auto after =
      std::upper_bound(parts.begin(), parts.end(), code,
                       [](std::uint64_t tile, const Plan& part) { return tile < part.begin; });
  return static_cast<std::uint32_t>(after - parts.begin());
}

PartPlans plan_parts(const StoreReader& store, const ExtractRequest& request, int level,
                     std::uint32_t count) {
  PartPlans plans;
  plans.grid = request.level->lattice.tiles();
  plans.looks_around = request.surface.drop_degenerate || request.surface.cap;
  divide_tiles(plans, count, [&](auto&& f) {
    visit_tiles(store, request, level, [&](const TileWork& work, std::uint64_t blocks) {
      for_each_active_block(work, request.surface.roi,
                            [&](Box3 cells) { plans.bounds = unite(plans.bounds, cells); });
      f(work, blocks);
    });
  });
  return plans;
}

}  // namespace isobrick

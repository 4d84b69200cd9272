#pragma once

#include <utility>

#include "pipeline/extract/extract_plan.h"
#include "stream/batch_decoder.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {

/// The tiles that are active at any of a pass's isovalues_of(). `store` must outlive them.
inline TileStream tiles_of(const StoreReader& store, int level, PassRequests requests) {
  const ExtractRequest& common = requests.front();
  TileStream tiles(store, level, isovalues_of(requests), common.surface.roi, common.search,
                   cap_search(common.surface));
  if (common.part) tiles.restrict_to(common.part->tiles);
  return tiles;
}

/// The same in batches as planned.
struct PlannedTiles {
  TileStream tiles;
  BatchPlanner batches;

  PlannedTiles(TileStream all, PassRequests requests, const ExtractPlan& plan)
      : tiles(std::move(all)),
        batches(tiles, requests.front().level->lattice, reach_of(requests),
                requests.front().surface.may_have_nan, plan.limits.tiles, plan.batch_bricks) {}
};

/// The same with a decoder that has begun: for a GPU, to whose memory the bricks go.
struct DecodedTiles {
  PlannedTiles planned;
  BatchDecoder decoder;

  /// `tiles` are of this level of `store`, which must outlive it, as `memory` must.
  DecodedTiles(const StoreReader& store, int level, TileStream tiles, PassRequests requests,
               const ExtractPlan& plan, BrickMemory& memory)
      : planned(std::move(tiles), requests, plan),
        decoder(store, level, planned.batches, reach_of(requests), plan.cache_bricks,
                requests.front().threads, memory) {}
};

}  // namespace isobrick

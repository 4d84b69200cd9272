#pragma once

#include <utility>

#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/stream/batch_decoder.h"
#include "isobrick/stream/tile_stream.h"

namespace isobrick {

/// The active tiles of an extraction. `store` must outlive them.
inline TileStream tiles_of(const StoreReader& store, const ExtractOptions& options,
                           const ExtractRequest& request) {
  return {store, options.level, options.isovalue, request.surface.roi, request.search};
}

/// The same in batches as planned.
struct PlannedTiles {
  TileStream tiles;
  BatchPlanner batches;

  PlannedTiles(TileStream all, const ExtractRequest& request, const ExtractPlan& plan)
      : tiles(std::move(all)),
        batches(tiles, request.level->lattice, sample_reach(request.surface),
                request.surface.may_have_nan, plan.limits.tiles, plan.batch_bricks) {}
};

/// The same with a decoder that has begun: for a GPU, to whose memory the bricks go.
struct DecodedTiles {
  PlannedTiles planned;
  BatchDecoder decoder;

  /// `tiles` are of this level of `store`, which must outlive it, as `memory` must.
  DecodedTiles(const StoreReader& store, int level, TileStream tiles, const ExtractRequest& request,
               const ExtractPlan& plan, BrickMemory& memory)
      : planned(std::move(tiles), request, plan),
        decoder(store, level, planned.batches, sample_reach(request.surface), plan.cache_bricks,
                request.threads, memory) {}
};

}  // namespace isobrick

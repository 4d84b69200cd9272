#pragma once

#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/stream/batch_decoder.h"
#include "isobrick/stream/tile_stream.h"

namespace isobrick {

/// The active tiles of an extraction, in batches as planned.
struct PlannedTiles {
  TileStream tiles;
  BatchPlanner batches;

  /// `store` must outlive it.
  PlannedTiles(const StoreReader& store, const ExtractOptions& options,
               const ExtractRequest& request, const ExtractPlan& plan)
      : tiles(store, options.level, options.isovalue, request.surface.roi, request.search),
        batches(tiles, request.level->lattice, sample_reach(request.surface),
                request.surface.may_have_nan, plan.limits.tiles, plan.batch_bricks) {}
};

/// The same with a decoder that has begun: for a GPU, to whose memory the bricks go.
struct DecodedTiles {
  PlannedTiles planned;
  BatchDecoder decoder;

  /// `store` and `memory` must outlive it.
  DecodedTiles(const StoreReader& store, const ExtractOptions& options,
               const ExtractRequest& request, const ExtractPlan& plan, BrickMemory& memory)
      : planned(store, options, request, plan),
        decoder(store, options.level, planned.batches, sample_reach(request.surface),
                plan.cache_bricks, request.threads, memory) {}
};

}  // namespace isobrick

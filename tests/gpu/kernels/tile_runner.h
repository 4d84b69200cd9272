#pragma once

#include <isobrick/scalar.h>
#include "gpu/resident/array_params.h"
#include "gpu/resident/gather_params.h"
#include "gpu/search/search_params.h"
#include "gpu/stream/unpack_params.h"
#include "gpu/tile/tile_params.h"

namespace isobrick::emulated {

// Runs kernels on the CPU, until all blocks have ended.

/// A kernel that extracts tiles, and how it is run.
struct TileRun {
  ScalarType type;
  bool normals = false, may_have_nan = false, on_samples = false, trilinear = false;
  unsigned threads = 384;
  unsigned blocks = 2;
  unsigned seed = 1;
};

void run_tiles(const TileRun& run, const gpu::TileParams& params, const gpu::CaseTable& cases);

void run_search(ScalarType type, const gpu::SearchParams& params, unsigned seed);
void run_tile_ranges(ScalarType type, const gpu::TileParams& params, const std::int32_t* tiles,
                     std::uint32_t count, void* ranges);
void run_first_columns(ScalarType type, const void* tile_blocks, std::uint32_t count,
                       void* columns);
void run_array_ranges(ScalarType type, const gpu::ArrayRangeParams& params, unsigned seed);
void run_load(ScalarType type, const gpu::ArrayLoadParams& params, unsigned seed);
void run_gather(ScalarType type, const gpu::GatherParams& params, unsigned seed);
void run_unpack(ScalarType type, const gpu::UnpackParams& params, unsigned seed);

}  // namespace isobrick::emulated

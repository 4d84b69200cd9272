#include "gpu/search/search_kernel.h"

#include "gpu/memory/cuda_check.h"
#include "gpu/search/search_tiles.cuh"

namespace isobrick::inline v0::gpu {

void launch_search(ScalarType type, const SearchParams& params, cudaStream_t stream) {
  const auto blocks = (params.count + kTilesOfSearchBlock - 1) / kTilesOfSearchBlock;
  visit_scalar(type, [&](auto tag) {
    search_tiles<typename decltype(tag)::type><<<blocks, kSearchThreads, 0, stream>>>(params);
  });
  check_launch("search_tiles");
}

void launch_tile_ranges(ScalarType type, const TileParams& params, const std::int32_t* tiles,
                        std::uint32_t count, void* ranges, cudaStream_t stream) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    find_tile_ranges<T>
        <<<count, kSearchThreads, 0, stream>>>(params, tiles, static_cast<T*>(ranges));
  });
  check_launch("find_tile_ranges");
}

void launch_first_columns(ScalarType type, const void* tile_blocks, std::uint32_t count,
                          void* columns, cudaStream_t stream) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    copy_first_columns<<<count, kSearchThreads, 0, stream>>>(static_cast<const T*>(tile_blocks),
                                                             static_cast<T*>(columns));
  });
  check_launch("copy_first_columns");
}

}  // namespace isobrick::gpu

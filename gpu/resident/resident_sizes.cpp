#include "gpu/resident/resident_sizes.h"

#include <algorithm>
#include <vector>

#include "core/morton.h"
#include "core/tile.h"
#include "gpu/search/search_params.h"
#include "gpu/tile/tile_params.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Mesh to expect of a tile before anything is known: some more than a sheet across it.
constexpr MeshSize kMeshOfTile{1600, 3200};
/// Case table, counters, sums of the search.
constexpr std::uint64_t kSmallObjects = 64 << 10;

}  // namespace

ResidentSizes resident_sizes(const Lattice& lattice, const ResidentTiles& tiles, bool normals,
                             bool on_samples, bool trilinear) {
  const auto grid = static_cast<std::uint64_t>(volume(lattice.tiles()));
  ResidentSizes sizes;
  sizes.volume_bytes =
      (tiles.loaded + 1) * (kTileBlockSamples + kColumnSamples) * lattice.sample_bytes() +
      tiles.searched * (3 * sizeof(std::int32_t) + 2 * lattice.sample_bytes()) +
      grid * sizeof(std::uint32_t);
  const std::uint64_t row_tables =
      std::max(tiles.active, std::min<std::uint64_t>(tiles.searched, kFirstRowTables));
  sizes.extractor_bytes =
      kSmallObjects + grid * sizeof(std::uint32_t) + row_tables * sizeof(RowTable) +
      (on_samples
           ? row_tables * sizeof(SampleTable) +
                 std::min<std::uint64_t>(tiles.searched, kMaxSampleBlocks) * sizeof(SampleWork)
           : 0) +
      (trilinear
           ? std::min<std::uint64_t>(tiles.searched, kMaxTrilinearBlocks) * sizeof(TrilinearWork) +
                 sizeof(TopologyTables)
           : 0) +
      tiles.searched * (sizeof(TileItem) + sizeof(OrderState)) +
      tiles.searched / kTilesOfSearchBlock * sizeof(unsigned long long) +
      mesh_bytes({tiles.active * kMeshOfTile.vertices, tiles.active * kMeshOfTile.triangles},
                 normals);
  return sizes;
}

std::vector<Int3> tiles_to_load(const Lattice& lattice, std::span<const Int3> searched,
                                Index reach) {
  const Int3 grid = lattice.tiles(), one{1, 1, 1};
  // A tile looks at the first samples of the tiles above it; layers around it lie in those below.
  const Int3 below{-reach, -reach, -reach};
  std::vector<bool> is_needed(static_cast<std::size_t>(volume(grid)));
  for (const Int3 tile : searched)
    for_each_point(intersect({tile + below, tile + one + one}, {{0, 0, 0}, grid}), [&](Int3 t) {
      is_needed[static_cast<std::size_t>(linear_index(t, grid))] = true;
    });
  std::vector<Int3> tiles;
  tiles.reserve(static_cast<std::size_t>(std::count(is_needed.begin(), is_needed.end(), true)));
  for_each_morton(grid, [&](Int3 t) {
    if (is_needed[static_cast<std::size_t>(linear_index(t, grid))]) tiles.push_back(t);
  });
  return tiles;
}

}  // namespace isobrick::gpu

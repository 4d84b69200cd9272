#include "isobrick/gpu/tile_index.h"

namespace isobrick::gpu {

std::optional<IndexKind> index_kind_of(TileSearch search) {
  switch (search) {
    case TileSearch::interval: return IndexKind::interval;
    case TileSearch::kdtree: return IndexKind::kdtree;
    case TileSearch::quadtree: return IndexKind::quadtree;
    case TileSearch::octree: return IndexKind::octree;
    case TileSearch::ranges:
    case TileSearch::none: break;
  }
  return std::nullopt;
}

TileTest test_of(TileSearch search) {
  if (search == TileSearch::none) return TileTest::all;
  if (search == TileSearch::ranges) return TileTest::ranges;
  return search == TileSearch::octree ? TileTest::mask_by_place : TileTest::mask_by_order;
}

SpanIndices index_tiles(const DeviceVolume::Impl& volume, IndexKind kind) {
  const Int3 tiles = volume.lattice.tiles();
  const bool in_space = kind == IndexKind::octree;
  RangesOfIndices input;
  input.first = {0, volume.tile_count};
  input.headers = {
      index_detail::header_for(kind, volume.lattice.type, volume.tile_count,
                               in_space ? tiles : Int3{Index{volume.tile_count}, 1, 1})};
  input.ranges = volume.ranges.data();
  DeviceBuffer<std::byte> placed;
  if (in_space) {
    placed = DeviceBuffer<std::byte>(volume.ranges.size(), volume.stream);
    launch_place_ranges(volume.lattice.type, volume.tiles.data(), volume.tile_count,
                        volume.params().tiles, volume.ranges.data(), placed.data(),
                        volume.stream.get());
    input.ranges = placed.data();
  }
  return SpanIndices(build_indices(input, volume.stream), volume.stream);
}

}  // namespace isobrick::gpu

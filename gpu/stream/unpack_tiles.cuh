#pragma once

#include "gpu/stream/unpack_params.h"
#include "gpu/tile/streamed_blocks.cuh"

// The kernel that lays the samples of streamed tiles out as tile blocks.

namespace isobrick::inline v0::gpu {

inline constexpr int kUnpackThreads = 512, kUnpackWarps = kUnpackThreads / 32;
/// Layers below a tile's own samples that there is room for.
inline constexpr int kBelow = 1, kPlaces = kBelow + 35;

/// The blocks of 16³ cells, as bits of TileWork, that lie within `reach` of a place
/// along an axis; `lower` are those of the lower half.
__device__ inline unsigned blocks_near(int at, int reach, unsigned lower) {
  return (at <= 16 + reach ? lower : 0u) | (at >= 16 - reach ? ~lower & 0xffu : 0u);
}

/// What there is to know of a coordinate along an axis of a tile.
struct AxisPlace {
  std::int64_t offset;  ///< in its brick, samples
  int brick;            ///< among the addresses of the tile; below 0 outside of the volume
  unsigned near;        ///< blocks that need it
};

/// A tile that is unpacked.
template <class T>
struct UnpackedTile {
  T* tile_blocks[27];
  AxisPlace places[3][kPlaces];
  const std::uint64_t* bricks;
  unsigned active;
  T side;

  __device__ const AxisPlace& at(int axis, int v) const { return places[axis][v + kBelow]; }
  __device__ T read(const AxisPlace& x, const AxisPlace& y, const AxisPlace& z, T fill) const {
    const std::uint64_t brick = bricks[x.brick + y.brick + z.brick];
    return brick ? reinterpret_cast<const T*>(brick)[x.offset + y.offset + z.offset] : fill;
  }
  /// Copies sample (x, y, z), or what it is as good as, to its block.
  __device__ void copy(int x, int y, int z, T fill) const {
    const AxisPlace &px = at(0, x), &py = at(1, y), &pz = at(2, z);
    const bool needed =
        (active & px.near & py.near & pz.near) != 0 && (px.brick | py.brick | pz.brick) >= 0;
    tile_blocks[13 + (x >> 5) + 3 * (y >> 5) + 9 * (z >> 5)]
               [(x & 31) | (y & 31) << 5 | (z & 31) << 10] = needed ? read(px, py, pz, fill) : side;
  }
};

template <class T>
__device__ void find_axis_places(UnpackedTile<T>& tile, const UnpackParams& p, const TileItem& item,
                                 const BrickBox& box) {
  const unsigned lower[3] = {0x55u, 0x33u, 0x0fu};
  const int origin[3] = {item.x * 32, item.y * 32, item.z * 32};
  std::int64_t step = 1;
  int bricks = 1;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const int v = static_cast<int>(threadIdx.x) - p.reach;
    if (v <= 32 + p.reach) {
      const int at = origin[axis] + v, brick = at / p.brick[axis];
      const bool inside = at >= 0 && at < p.extent[axis];
      tile.places[axis][v + kBelow] = {(at - brick * p.brick[axis]) * step,
                                       inside ? (brick - box.first[axis]) * bricks : -1,
                                       blocks_near(v, p.reach, lower[axis])};
    }
    step *= p.brick[axis];
    bricks *= box.count[axis];
  }
}

/// The place of the sample that all blocks of a tile share.
__device__ inline int shared_place(std::int32_t extent, std::int32_t tile) {
  return ::min(16, extent - 1 - 32 * tile);
}

template <class T>
__global__ void __launch_bounds__(kUnpackThreads)
    unpack_tiles(const __grid_constant__ UnpackParams p) {
  __shared__ UnpackedTile<T> tile;
  const TileItem item = p.items[blockIdx.x];
  const T fill = static_cast<T>(p.fill_value);
  find_axis_places(tile, p, item, p.boxes[blockIdx.x]);
  if (threadIdx.x < 27)
    tile.tile_blocks[threadIdx.x] =
        static_cast<T*>(p.tile_blocks) + streamed_block(blockIdx.x, static_cast<int>(threadIdx.x));
  if (threadIdx.x == 0) {
    tile.bricks = p.bricks + std::size_t{blockIdx.x} * p.tile_bricks;
    tile.active = p.links[blockIdx.x].active_blocks;
  }
  __syncthreads();
  if (threadIdx.x == 0)
    tile.side = tile.read(tile.at(0, shared_place(p.extent[0], item.x)),
                          tile.at(1, shared_place(p.extent[1], item.y)),
                          tile.at(2, shared_place(p.extent[2], item.z)), fill);
  __syncthreads();
  const int low = -p.reach, edge = 33 + 2 * p.reach;
  const auto outside = [](int v) { return v < 0 || v > 32; };
  // Rows of 32 samples a warp; then the columns beside them, a sample a thread.
  const int x = static_cast<int>(threadIdx.x % 32);
#pragma unroll 4
  for (int row = static_cast<int>(threadIdx.x / 32); row < edge * edge; row += kUnpackWarps) {
    const int y = low + row % edge, z = low + row / edge;
    if (p.corners || !(outside(y) && outside(z))) tile.copy(x, y, z, fill);
  }
  for (int i = static_cast<int>(threadIdx.x); i < (edge - 32) * edge * edge; i += kUnpackThreads) {
    const int column = i / (edge * edge), row = i % (edge * edge);
    const int beside = column < p.reach ? low + column : 32 + column - p.reach;
    const int y = low + row % edge, z = low + row / edge;
    if (p.corners || outside(beside) + outside(y) + outside(z) <= 1) tile.copy(beside, y, z, fill);
  }
}

}  // namespace isobrick::gpu

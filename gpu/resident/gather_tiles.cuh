#pragma once

#include "gpu/resident/gather_params.h"

// The kernel that gathers tiles of 32³ samples from bricks on the device. It moves pieces of rows,
// of 16 bytes where the bricks' rows have whole ones, else samples.

namespace isobrick::inline v0::gpu {

inline constexpr int kGatherThreads = 256;

/// A coordinate along an axis, in the bricks of a tile.
struct GatherPlace {
  std::int64_t offset;  ///< in its brick, samples
  int brick;            ///< among the addresses of the tile; below 0 outside of the volume
};

__device__ inline GatherPlace gather_place(const GatherParams& p, const BrickBox& box, int axis,
                                           int at) {
  if (at >= p.extent[axis]) return {0, -1};
  const int brick = at / p.brick[axis];
  std::int64_t step = 1;
  int bricks = 1;
  for (int a = 0; a < axis; ++a) {
    step *= p.brick[a];
    bricks *= box.count[a];
  }
  return {(at - brick * p.brick[axis]) * step, (brick - box.first[axis]) * bricks};
}

/// 16 bytes of samples.
template <class T>
struct alignas(16) SamplePiece {
  T samples[16 / sizeof(T)];
};

template <class T>
__device__ inline SamplePiece<T> filled_piece(T value, SamplePiece<T>) {
  SamplePiece<T> piece;
  for (T& sample : piece.samples) sample = value;
  return piece;
}
template <class T>
__device__ inline T filled_piece(T value, T) {
  return value;
}

/// Whether each row of a brick is made of whole pieces.
template <class T>
inline bool has_pieces(const GatherParams& p) {
  return p.brick[0] * static_cast<int>(sizeof(T)) % 16 == 0;
}

/// A block of threads copies a tile, in pieces of type Piece. What lies outside of the volume is
/// never read: it stays as it is.
template <class T, class Piece>
__global__ void __launch_bounds__(kGatherThreads)
    gather_tiles(const __grid_constant__ GatherParams p) {
  constexpr int samples = sizeof(Piece) / sizeof(T), pieces = 32 / samples;
  __shared__ GatherPlace places[3][32];
  const std::uint64_t* const bricks = p.bricks + std::size_t{blockIdx.x} * p.tile_bricks;
  if (threadIdx.x < 96) {
    const int axis = static_cast<int>(threadIdx.x) / 32, v = static_cast<int>(threadIdx.x) % 32;
    places[axis][v] = gather_place(p, p.boxes[blockIdx.x], axis,
                                   p.tiles[3 * std::size_t{blockIdx.x} + axis] * 32 + v);
  }
  __syncthreads();
  Piece* const to = static_cast<Piece*>(p.tile_blocks) + std::size_t{blockIdx.x} * 1024 * pieces;
  const Piece fill = filled_piece(static_cast<T>(p.fill_value), Piece{});
#pragma unroll 4
  for (int i = static_cast<int>(threadIdx.x); i < 1024 * pieces; i += kGatherThreads) {
    const GatherPlace &x = places[0][i % pieces * samples], &y = places[1][i / pieces % 32],
                      &z = places[2][i / pieces / 32];
    if ((x.brick | y.brick | z.brick) < 0) continue;
    const std::uint64_t brick = bricks[x.brick + y.brick + z.brick];
    const std::int64_t offset = x.offset + y.offset + z.offset;
    to[i] =
        brick ? *reinterpret_cast<const Piece*>(reinterpret_cast<const T*>(brick) + offset) : fill;
  }
}

}  // namespace isobrick::gpu

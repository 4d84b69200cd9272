#pragma once

#include "gpu/tile/tile_lists.cuh"

// The triangles of a tile, written where they belong.

namespace isobrick::inline v0::gpu {

/// How far behind a row's word its number lies, in bytes.
inline constexpr std::uint32_t kNumberOfWord =
    offsetof(TileShared, number) - offsetof(TileShared, edge_bits);

/// Fills the tables of places and triangles; once a block.
template <int N>
__device__ inline void fill_tables(TileShared& s, const CaseTable* cases) {
  for (unsigned i = own_thread(); i < sizeof(CaseTable) / sizeof(uint4); i += N)
    reinterpret_cast<uint4*>(&s.cases)[i] = __ldg(reinterpret_cast<const uint4*>(cases) + i);
  for (unsigned t = own_thread(); t < 24; t += N) {
    const unsigned e = t % 12, at_0 = t / 12;
    const unsigned axis = e / 4, first = e & 1u, second = e >> 1 & 1u;
    const unsigned row = axis == 0 ? first + 33 * second : axis == 1 ? 33 * second : second;
    // The word that belongs to a number at sample 0 is never counted.
    const std::size_t array = offsetof(TileShared, at_0) - kNumberOfWord;
    s.places[at_0][e].offset = static_cast<std::uint32_t>(
        axis > 0 && at_0 && first == 0
            ? array + 4 * (kRowPitch * (axis - 1) + row)
            : offsetof(TileShared, edge_bits) + 4 * (kRowPitch * axis + row));
  }
}

/// The numbers in the mesh from those in the tile. The lower of a cell's edges along
/// y and z are counted by the mask of its upper ones, so one too many. The last warp: the first
/// ones have other rows to see to.
template <int N>
__device__ inline void number_edges(TileShared& s) {
  const unsigned t = own_thread() - (N - 32);
  if (t >= 24) return;
  const unsigned e = t % 12, at_0 = t / 12;
  const bool lower = e >= 4 && (e & 1u) == 0;
  s.places[at_0][e].addend = s.number_base - (lower && !at_0 ? 1u : 0u);
}

/// The place with that address in shared memory. Addresses in TileShared::places are put
/// together by or, which the compiler would not do.
__device__ inline EdgePlace place_at(std::uint32_t address) {
  EdgePlace place;
  load_shared(address, place.offset, place.addend);
  return place;
}

/// Where the places of the edges of a cell at `x` begin. `places` is the address of the table.
__device__ inline std::uint32_t places_of(const TileShared& s, std::uint32_t places,
                                          std::uint32_t x) {
  return x == 0 ? places + static_cast<std::uint32_t>(sizeof s.places[0]) : places;
}

/// The number in the mesh of the vertex on an edge of a cell. `place` is the address of the edge's
/// place, `row` four times the cell's row, `mask` the bits below its x.
__device__ inline std::uint32_t number_on_edge(const TileShared& s, std::uint32_t place,
                                               std::uint32_t row, std::uint32_t mask) {
  const char* base = reinterpret_cast<const char*>(&s);
  const auto word = [base](std::uint32_t at) {
    return *reinterpret_cast<const std::uint32_t*>(base + at);
  };
  const EdgePlace edge = place_at(place);
  const std::uint32_t at = row + edge.offset;
  return word(at + kNumberOfWord) + edge.addend +
         static_cast<std::uint32_t>(__popc(word(at) & mask));
}

/// Writes triangle `number` of a listed cell. `places` is the address of the table.
__device__ inline void write_triangle(const TileShared& s, std::uint32_t places, std::uint32_t cell,
                                      std::uint32_t number, Triangle& to) {
  const std::uint32_t x = cell & 31u, row = cell >> 3 & 0x1ffcu, mask = low_bits(x);
  const std::uint32_t edges = s.cases.triangles[5 * __byte_perm(cell, 0, 0x4442) + number];
  const std::uint32_t of_x = places_of(s, places, x);
  std::uint32_t corners[3];
#pragma unroll
  for (int c = 0; c < 3; ++c)
    corners[c] = number_on_edge(s, (edges >> 4 * c & 0x78u) | of_x, row, mask);
#pragma unroll
  for (int c = 0; c < 3; ++c) __stcs(&to[static_cast<std::size_t>(c)], corners[c]);
}

__device__ inline std::uint32_t warp_or(std::uint32_t v) {
#if __CUDA_ARCH__ >= 800
  return __reduce_or_sync(kFullMask, v);
#else
#pragma unroll
  for (int d = 16; d; d /= 2) v |= __shfl_xor_sync(kFullMask, v, d);
  return v;
#endif
}

/// The next triangles of a warp's cells that are to be written, at most 32 at a time
/// whatever cells they come from, so that no thread idles. All threads have the same.
struct PendingTriangles {
  std::uint32_t cell;    ///< listed cells that have begun before the first of them
  std::uint32_t into;    ///< triangles of the last of those that are written
  std::uint32_t starts;  ///< bit i: with triangle i a cell begins

  /// One a lane. `lanes` are the own lane and those below.
  __device__ void write(const TileShared& s, std::uint32_t places, const std::uint32_t* cells,
                        std::uint32_t lanes, Triangle& to) const {
    const std::uint32_t begun = starts & lanes;
    const auto from = static_cast<std::uint32_t>(31 - __clz(static_cast<int>(begun)));
    write_triangle(s, places, cells[cell + __popc(begun) - 1],
                   begun ? lane_id() - from : lane_id() + into, to);
  }
  __device__ void pass_32() {
    into = starts ? 1 + static_cast<std::uint32_t>(__clz(static_cast<int>(starts))) : into + 32;
    cell += __popc(starts);
  }
};

/// Writes the triangles of the listed cells; `base` is the number of the first of
/// them in the mesh.
template <int N>
__device__ inline void write_listed_triangles(TileShared& s, const TileParams& p,
                                              std::uint32_t listed, std::uint64_t base) {
  const WarpPart part = part_beside_first<N, 3, 4>(listed);  // it takes the next tile
  const std::uint32_t* cells = lists_of<N>(s).cells;
  const std::uint16_t* group_triangles = lists_of<N>(s).group_triangles;
  Triangle* const to = kept(p.triangles + base);
  std::uint32_t number = triangles_before<N>(s, part.begin / 32) + lane_id();
  const std::uint32_t lanes = kept(lanes_below() << 1 | 1u);
  const auto places = kept(static_cast<std::uint32_t>(__cvta_generic_to_shared(s.places)));
  PendingTriangles pending{part.begin, 0, 0};
  std::uint32_t waiting = 0;
  for (std::uint32_t begin = part.begin; begin < part.end; begin += 32) {
    const std::uint32_t i = begin + lane_id();
    // Where among the waiting triangles the cell's begin.
    std::uint32_t place = i < part.end ? waiting + (cells[i] >> 24) : kNone;
    waiting += group_triangles[begin / 32];
    pending.starts |= warp_or(bit_at(place));
#pragma unroll 1
    for (; waiting >= 32; waiting -= 32, number += 32) {
      pending.write(s, places, cells, lanes, to[number]);
      pending.pass_32();
      place -= 32;
      pending.starts = warp_or(bit_at(place));
    }
  }
  if (lane_id() < waiting) pending.write(s, places, cells, lanes, to[number]);
}

}  // namespace isobrick::gpu

#pragma once

#include <algorithm>

#include "isobrick/gpu/stand_by.cuh"
#include "isobrick/gpu/tile_mesh.cuh"
#include "isobrick/gpu/tile_take.cuh"

// The kernel: a team of threads makes the meshes of one tile after the other, or of a slab of one.

namespace isobrick::gpu {

template <std::uint32_t Listed, bool Nan = false, bool Slab = false>
constexpr std::size_t kSharedBytes = sizeof(TileShared) +
                                     (Nan ? std::max(sizeof(Lists<Listed>), sizeof(NanRows))
                                          : sizeof(Lists<Listed>)) +
                                     (Slab ? sizeof(RowTable) + sizeof(SlabTiles) : 0);

static_assert(kSharedBytes<kListedBeforeAmpere, true> <= 64 << 10, "what Turing has");
static_assert(kSharedBytes<kListedBeforeAmpere, false, true> <= 64 << 10, "what Turing has");
// What Hopper's multiprocessors have; of each block they take 1 KiB for themselves.
static_assert(3 * (kSharedBytes<Team<384>::kMostListed, true> + 1024) <= 228 << 10, "three teams");
static_assert(3 * (kSharedBytes<Team<kSlabTeam>::kMostListed, false, true> + 1024) <= 228 << 10);
static_assert(2 * (kSharedBytes<Team<640>::kMostListed> + 1024) <= 228 << 10, "two teams");
static_assert(kSharedBytes<Team<1024>::kMostListed> <= 99 << 10, "what any later device has");

/// The last block to come here tells the host and leaves the counters as the next launch needs
/// them. Nobody reads what the others have written before the launch is over, or before all blocks
/// of one that stays have said so once more (stand_by.cuh), and the sums they ask each other for
/// are not zeroed by this launch but by the next, or by its search: nothing has to be in order with
/// the count.
template <int N>
__device__ void end_launch(TileShared& s, const TileParams& p) {
  const LaunchEnd& end = p.end;
  if (!end.report) return;
  for (std::uint32_t i = blockIdx.x * N + own_thread(); i < end.next_items; i += gridDim.x * N)
    (Team<N>::kSlabs > 1 ? s.now.next_order : end.next_order)[i] = {0, 0};
  if (threadIdx.x == 0)
    s.done_before = DeviceFlag(*end.done).fetch_add(1, cuda::memory_order_relaxed);
  __syncthreads();
  if (s.done_before + 1 < gridDim.x) return;
  if (threadIdx.x == 0) {
    say<N>(s, p, LaunchReport::kActiveTiles,
           p.candidates.count > 0 ? s.items / Team<N>::kSlabs : *end.found);
    if (s.items == 0) {
      say<N>(s, p, LaunchReport::kVertices, 0);
      say<N>(s, p, LaunchReport::kTriangles, 0);
    }
  }
  for (std::uint32_t i = own_thread(); i < end.zero_words; i += N)
    DeviceFlag(end.zero[i]).store(0, cuda::memory_order_relaxed);  // others have added to them
}

template <int N, class T, bool Normals, bool Nan>
__global__ void __launch_bounds__(N, Team<N>::kTeams)
    extract_tiles(const __grid_constant__ TileParams p, const T threshold,
                  const CaseTable* __restrict__ cases) {
  extern __shared__ __align__(256) unsigned char shared_bytes[];
  TileShared& s = *reinterpret_cast<TileShared*>(shared_bytes);
  constexpr bool kSlab = Team<N>::kSlabs > 1;
  if constexpr (!kSlab) begin_in_turns(p);
  const std::uint32_t first = first_number(p);
  if constexpr (!kSlab) {
    if (p.candidates.count > 0) take_found(s, p);
    fill_tables<N>(s, cases);
  }
  Classifier<T> classifier(threshold);
  bool has_tables = !kSlab;
  wait_for_launch_before();
  if (threadIdx.x == 0) {
    if (kSlab) begin_launch(s.now, p);
    s.all_cells = s.all_vertices = ListsOf<N>::kListed;
    init_barriers<N>(s.barriers);
    if (kSlab)
      s.items = p.found * Team<N>::kSlabs;
    else if (p.candidates.count == 0)
      s.items = *p.item_count;
  }
  __syncwarp();
  take_tile<N, T>(s, p, first);
  __syncthreads();
  for (;;) {
    while (s.item < s.items) {
      if constexpr (kSlab) {
        if (!has_tables) fill_tables<N>(s, cases);
        has_tables = true;
        if (warp_id() == Team<N>::kVertices) Neighbour::of_slab<N>(s, p).keep(s);
      }
      if constexpr (Nan)
        find_nan<N, T>(s, p);
      else
        clear_lists<N>(s, s.all_cells, s.all_vertices);
      classify<N>(s, p, classifier);
      __syncthreads();
      if (count_tile<N, Nan>(s, p)) make_mesh_of_tile<N, T, Normals, Nan>(s, p);
      if (s.items <= gridDim.x) {  // each block has one at most
        __syncthreads();
        break;
      }
      // No earlier than this: a tile that is taken but not begun holds all later ones up.
      take_tile<N, T>(s, p, next_number(p));
      __syncthreads();
    }
    end_launch<N>(s, p);
    if constexpr (!kSlab) return;
    if (!stand_by<N, T>(s, p)) return;
    classifier = Classifier<T>(threshold_of<T>(s.now));
  }
}

}  // namespace isobrick::gpu

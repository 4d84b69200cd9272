#include "isobrick/gpu/tile_kernel.h"

#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/tile_emit.cuh"
#include "isobrick/gpu/tile_order.cuh"
#include "isobrick/surface/case_tables.h"

namespace isobrick::gpu {
namespace {

constexpr int kThreadsPerMultiprocessor = 1152;
/// Threads that share a tile where there are many tiles, and where there are few.
constexpr int kSmallTeam = 288, kLargeTeam = 1024;

/// Blocks of N threads a multiprocessor: shared memory has room for four.
constexpr int blocks_of(int n) {
  return kThreadsPerMultiprocessor / n < 4 ? kThreadsPerMultiprocessor / n : 4;
}

/// Pages of the tiles around one; where there is none, any that is.
__device__ void find_pages(TileShared& s, const TileParams& p, const TileItem& item,
                           std::size_t page_bytes) {
  if (threadIdx.x >= 27) return;
  const int n = static_cast<int>(threadIdx.x);
  const int x = item.x + n % 3 - 1, y = item.y + n / 3 % 3 - 1, z = item.z + n / 9 - 1;
  const bool exists =
      x >= 0 && y >= 0 && z >= 0 && x < p.tiles[0] && y < p.tiles[1] && z < p.tiles[2];
  std::uint32_t page = p.fill_page;
  if (exists) {
    const std::uint32_t own =
        p.page_of_tile[(static_cast<std::int64_t>(z) * p.tiles[1] + y) * p.tiles[0] + x];
    if (own != kNone) page = own;
  }
  s.pages[n] = static_cast<const char*>(p.pages) + page * page_bytes;
}

/// Brings the samples of a tile that is about to be taken into the L2 cache.
template <int N, class T>
__device__ void prefetch_tile(const TileParams& p, std::uint32_t number) {
  if (number >= *p.item_count) return;
  const TileItem item = p.items[number];
  const std::uint32_t page =
      p.page_of_tile[(static_cast<std::int64_t>(item.z) * p.tiles[1] + item.y) * p.tiles[0] +
                     item.x];
  if (page == kNone) return;
  constexpr std::size_t bytes = kPageSamples * sizeof(T);
  const char* from = static_cast<const char*>(p.pages) + page * bytes;
  for (std::size_t at = threadIdx.x * 128; at < bytes; at += N * 128)
    asm volatile("prefetch.global.L2 [%0];" ::"l"(from + at));
}

template <int N>
constexpr std::size_t shared_bytes() {
  return sizeof(TileShared) + Team<N>::kWarps * sizeof(WarpShared);
}

template <int N, class T, bool Normals>
__global__ void __launch_bounds__(N, blocks_of(N))
    extract_tiles(const __grid_constant__ TileParams p, const T threshold,
                  const std::uint16_t* __restrict__ case_entries) {
  extern __shared__ __align__(16) unsigned char bytes[];
  TileShared& s = *reinterpret_cast<TileShared*>(bytes);
  WarpShared& own = reinterpret_cast<WarpShared*>(bytes + sizeof(TileShared))[warp_id()];
  fill_tables<N>(s, case_entries);
  const Classifier<T> classifier(threshold);
  const std::uint32_t items = *p.item_count;
  for (;;) {
    // No earlier than this: a tile that is taken but not begun holds all later ones up.
    if (threadIdx.x == 0) s.item = atomicAdd(p.ticket, 1u);
    __syncthreads();
    const std::uint32_t number = s.item;
    if (number >= items) return;
    const TileItem item = p.items[number];
    const Shape shape = shape_of(p, item);
    RowTable& table = p.row_tables[item.slot];
    find_pages(s, p, item, kPageSamples * sizeof(T));
    clear_lists<N>(s);
    __syncthreads();
    classify<N>(s, classifier);
    __syncthreads();
    {
      RowCounts<N> counts;
      count_rows<N>(s, shape, counts);
      __syncthreads();
      if (warp_id() == 0) {
        sum_steps<N>(s);
        if (lane_id() == 31) publish_sum(p.order[number].vertices, number, s.all_vertices);
      }
      __syncthreads();
      publish_rows<N>(s, counts, table);
      __threadfence();
      __syncthreads();
    }
    const std::uint32_t vertices = s.all_vertices, cells = s.all_cells;
    std::uint64_t triangles = 0;
    SumOfWarps sums{0, 0};
    for (std::uint32_t first = 0; first < cells; first += kListed) {
      if (first > 0) mark_cells<N>(s, first);
      const std::uint32_t found = find_cells<N>(s, shape, first, ::min(cells - first, kListed));
      if (lane_id() == 0) s.warp_triangles[warp_id()] = found;
      __syncthreads();
      sums = sum_of_warps<N>(s.warp_triangles);
      triangles += sums.all;
      __syncthreads();
    }
    if (warp_id() == 0) {
      if (lane_id() == 0) publish_sum(p.order[number].triangles, number, triangles);
      find_vertex_base(s, p, number, table);
    }
    __syncthreads();
    prefetch_tile<N, T>(p, number + gridDim.x);
    if (s.vertex_base + vertices <= p.vertex_capacity)
      for (std::uint32_t first = 0; first < vertices; first += kListed) {
        if (first > 0) mark_vertices<N>(s, first);
        emit_vertices<N, T, Normals>(s, own, p, shape, first, ::min(vertices - first, kListed));
        if (vertices > kListed) __syncthreads();
      }
    if (warp_id() == 0) find_triangle_base(s, p, number, triangles);
    if (warp_id() == (Team<N>::kWarps > 1 ? 1 : 0)) wait_for_neighbours(s, p, item, shape);
    __syncthreads();
    shift_rows<N>(s, p, shape);
    __syncthreads();
    borrow_rows<N>(s, shape);
    __syncthreads();
    if (shape.lo[0] > 0) {
      clip_rows<N>(s, shape);
      __syncthreads();
    }
    if (s.triangle_base + triangles <= p.triangle_capacity) {
      std::uint64_t base = s.triangle_base;
      for (std::uint32_t first = 0; first < cells; first += kListed) {
        const std::uint32_t listed = ::min(cells - first, kListed);
        if (cells > kListed) {
          mark_cells<N>(s, first);
          const std::uint32_t found = find_cells<N>(s, shape, first, listed);
          if (lane_id() == 0) s.warp_triangles[warp_id()] = found;
          __syncthreads();
          sums = sum_of_warps<N>(s.warp_triangles);
        }
        emit_triangles<N>(s, own, p, listed, base + sums.before);
        base += sums.all;
        __syncthreads();
      }
    }
    __syncthreads();
  }
}

/// How many blocks fill the device, and how they are launched.
template <int N, class T, bool Normals>
struct Launcher {
  static void prepare() {
    check(cudaFuncSetAttribute(extract_tiles<N, T, Normals>,
                               cudaFuncAttributeMaxDynamicSharedMemorySize, shared_bytes<N>()));
  }
  /// 0 where the device has too little shared memory for one.
  static int blocks() {
    int device = 0, multiprocessors = 0, each = 0, shared = 0;
    check(cudaGetDevice(&device));
    check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device));
    check(cudaDeviceGetAttribute(&shared, cudaDevAttrMaxSharedMemoryPerBlockOptin, device));
    if (static_cast<std::size_t>(shared) < shared_bytes<N>()) return 0;
    prepare();
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, extract_tiles<N, T, Normals>, N,
                                                        shared_bytes<N>()));
    return each * multiprocessors;
  }
  static void launch(const TileParams& params, const std::uint16_t* case_entries, int blocks,
                     cudaStream_t stream) {
    extract_tiles<N, T, Normals><<<blocks, N, shared_bytes<N>(), stream>>>(
        params, Threshold<T>(params.isovalue).value, case_entries);
    check_launch("extract_tiles");
  }
};

/// The number of threads is kSmallTeam or kLargeTeam; the others have
/// kernels for bytes without normals only.
template <class F>
auto visit_launcher(ScalarType type, bool normals, int threads, F&& f) {
  using Byte = std::uint8_t;
  switch (threads) {
    case 32: return f(Launcher<32, Byte, false>());
    case 64: return f(Launcher<64, Byte, false>());
    case 128: return f(Launcher<128, Byte, false>());
    case 256: return f(Launcher<256, Byte, false>());
    case 512: return f(Launcher<512, Byte, false>());
    default: break;
  }
  return visit_device_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    if (threads == kLargeTeam)
      return normals ? f(Launcher<kLargeTeam, T, true>()) : f(Launcher<kLargeTeam, T, false>());
    return normals ? f(Launcher<kSmallTeam, T, true>()) : f(Launcher<kSmallTeam, T, false>());
  });
}

void check_threads(ScalarType type, bool normals, int threads) {
  for (const int known : {0, kSmallTeam, kLargeTeam})
    if (threads == known) return;
  for (const int known : {32, 64, 128, 256, 512})
    if (threads == known && type == ScalarType::u8 && !normals) return;
  throw UsageError(
      "288 or 1024 threads share a tile, and for u8 without normals also 32, 64, 128, 256 or 512");
}

}  // namespace

void make_case_entries(bool mirrored, std::uint16_t (&entries)[kCaseEntries]) {
  const CaseTables& tables = mirrored ? kMirroredCaseTables : kCaseTables;
  for (std::size_t c = 0; c < 256; ++c)
    for (std::size_t t = 0; t < 5; ++t) {
      const std::uint8_t* e = tables.edges[c].data() + 3 * t;
      const unsigned edges = t < tables.triangles[c] ? e[0] | e[1] << 4 | e[2] << 8 : 0;
      entries[5 * c + t] =
          static_cast<std::uint16_t>(edges | (t == 0 ? tables.triangles[c] << 12 : 0));
    }
}

LaunchShape launch_shape(ScalarType type, bool normals, std::uint32_t tiles, int threads) {
  check_threads(type, normals, threads);
  const auto blocks = [&](int n) {
    return visit_launcher(type, normals, n, [](auto l) { return l.blocks(); });
  };
  if (threads > 0) {
    const LaunchShape shape{blocks(threads), threads};
    if (shape.blocks == 0) throw UsageError("the device has too little shared memory for that");
    return shape;
  }
  const LaunchShape small{blocks(kSmallTeam), kSmallTeam};
  if (tiles > static_cast<std::uint32_t>(small.blocks)) return small;
  const LaunchShape large{blocks(kLargeTeam), kLargeTeam};
  return large.blocks > 0 ? large : small;
}

void launch_extraction(ScalarType type, bool normals, const TileParams& params,
                       const std::uint16_t* case_entries, LaunchShape shape, cudaStream_t stream) {
  visit_launcher(type, normals, shape.threads,
                 [&](auto l) { l.launch(params, case_entries, shape.blocks, stream); });
}

}  // namespace isobrick::gpu

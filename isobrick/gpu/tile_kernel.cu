#include "isobrick/gpu/tile_kernel.h"

#include "isobrick/core/threshold.h"
#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/tile_emit.cuh"
#include "isobrick/gpu/tile_order.cuh"
#include "isobrick/surface/case_tables.h"

namespace isobrick::gpu {
namespace {

constexpr int kBlocksPerMultiprocessor = 4;

/// Pages of the tiles around one; where there is none, any that is.
__device__ void find_pages(TileShared& s, const TileParams& p, const TileItem& item,
                           std::size_t page_bytes) {
  if (threadIdx.x >= 27) return;
  const int n = static_cast<int>(threadIdx.x);
  const int x = item.x + n % 3 - 1, y = item.y + n / 3 % 3 - 1, z = item.z + n / 9 - 1;
  const bool exists = x >= 0 && y >= 0 && z >= 0 && x < p.tiles[0] && y < p.tiles[1] &&
                      z < p.tiles[2];
  std::uint32_t page = p.fill_page;
  if (exists) {
    const std::uint32_t own =
        p.page_of_tile[(static_cast<std::int64_t>(z) * p.tiles[1] + y) * p.tiles[0] + x];
    if (own != kNone) page = own;
  }
  s.pages[n] = static_cast<const char*>(p.pages) + page * page_bytes;
}

template <class T, bool Normals>
__global__ void __launch_bounds__(kThreads, kBlocksPerMultiprocessor)
    extract_tiles(const __grid_constant__ TileParams p, const T threshold,
                  const std::uint16_t* __restrict__ case_entries) {
  extern __shared__ __align__(16) unsigned char shared_bytes[];
  TileShared& s = *reinterpret_cast<TileShared*>(shared_bytes);
  fill_tables(s, case_entries);
  const Classifier<T> classifier(threshold);
  const std::uint32_t items = *p.item_count;
  for (;;) {
    if (threadIdx.x == 0) s.item = atomicAdd(p.ticket, 1u);
    __syncthreads();
    const std::uint32_t number = s.item;
    if (number >= items) return;
    const TileItem item = p.items[number];
    const Shape shape = shape_of(p, item);
    find_pages(s, p, item, kPageSamples * sizeof(T));
    __syncthreads();
    classify(s, classifier);
    __syncthreads();

    RowPrefix prefix;
    count_rows(s, shape, prefix);
    __syncthreads();
    const SumOfWarps vertices = sum_of_warps(s.warp_vertices), cells = sum_of_warps(s.warp_cells);
    RowTable& table = p.row_tables[item.slot];
    publish_rows(s, shape, prefix, vertices.before, vertices.all, table);
    __threadfence();
    std::uint64_t triangles = 0;
    std::uint32_t listed = 0;
    for (std::uint32_t first = 0; first < cells.all; first += kListed) {
      listed = ::min(cells.all - first, kListed);
      list_cells(s, shape, prefix, cells.before, first);
      __syncthreads();
      const std::uint32_t own = find_cases(s, listed);
      if (lane_id() == 0) s.warp_triangles[threadIdx.x >> 5] = own;
      __syncthreads();
      triangles += sum_of_warps(s.warp_triangles).all;
    }
    __syncthreads();
    // Warp 0 finds the tile's place while the others list its vertices.
    if (threadIdx.x < 32) find_place(s, p, vertices.all, triangles, table);
    list_edges(s, shape, prefix, vertices.before, 0);
    __syncthreads();
    if (s.vertex_base + vertices.all <= p.vertex_capacity)
      for (std::uint32_t first = 0; first < vertices.all; first += kListed) {
        if (first > 0) {
          list_edges(s, shape, prefix, vertices.before, first);
          __syncthreads();
        }
        emit_vertices<T, Normals>(s, p, shape, first, ::min(vertices.all - first, kListed));
        __syncthreads();
      }
    if (threadIdx.x < 32) wait_for_neighbours(s, p, item, shape);
    __syncthreads();
    adopt_numbers(s, p, shape);
    __syncthreads();
    if (s.triangle_base + triangles <= p.triangle_capacity) {
      std::uint64_t base = s.triangle_base;
      for (std::uint32_t first = 0; first < cells.all; first += kListed) {
        if (cells.all > kListed) {
          listed = ::min(cells.all - first, kListed);
          list_cells(s, shape, prefix, cells.before, first);
          __syncthreads();
          const std::uint32_t own = find_cases(s, listed);
          if (lane_id() == 0) s.warp_triangles[threadIdx.x >> 5] = own;
          __syncthreads();
        }
        const SumOfWarps sums = sum_of_warps(s.warp_triangles);
        emit_triangles(s, p, listed, base + sums.before);
        base += sums.all;
        __syncthreads();
      }
    }
    __syncthreads();
  }
}

template <class T, bool Normals>
void prepare() {
  check(cudaFuncSetAttribute(extract_tiles<T, Normals>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                             sizeof(TileShared)));
}

template <class T, bool Normals>
void launch(const TileParams& params, const std::uint16_t* case_entries, int blocks,
            cudaStream_t stream) {
  prepare<T, Normals>();
  extract_tiles<T, Normals><<<blocks, kThreads, sizeof(TileShared), stream>>>(
      params, Threshold<T>(params.isovalue).value, case_entries);
  check_launch("extract_tiles");
}

template <class T, bool Normals>
int resident_blocks() {
  prepare<T, Normals>();
  int device = 0, multiprocessors = 0, each = 0;
  check(cudaGetDevice(&device));
  check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device));
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, extract_tiles<T, Normals>, kThreads,
                                                      sizeof(TileShared)));
  return each * multiprocessors;
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

int extraction_blocks(ScalarType type, bool normals) {
  return visit_device_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return normals ? resident_blocks<T, true>() : resident_blocks<T, false>();
  });
}

void launch_extraction(ScalarType type, bool normals, const TileParams& params,
                       const std::uint16_t* case_entries, int blocks, cudaStream_t stream) {
  visit_device_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    normals ? launch<T, true>(params, case_entries, blocks, stream)
            : launch<T, false>(params, case_entries, blocks, stream);
  });
}

}  // namespace isobrick::gpu

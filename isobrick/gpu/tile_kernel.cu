#include "isobrick/gpu/tile_kernel.h"

#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/tile_count.cuh"
#include "isobrick/gpu/tile_emit.cuh"
#include "isobrick/gpu/tile_nan.cuh"
#include "isobrick/gpu/tile_order.cuh"
#include "isobrick/gpu/tile_take.cuh"
#include "isobrick/surface/case_tables.h"

namespace isobrick::gpu {
namespace {

template <std::uint32_t Listed, bool Nan = false>
constexpr std::size_t kSharedBytes = sizeof(TileShared) +
                                     (Nan ? std::max(sizeof(Lists<Listed>), sizeof(NanRows))
                                          : sizeof(Lists<Listed>));

static_assert(kSharedBytes<kListedBeforeAmpere, true> <= 64 << 10, "what Turing has");
static_assert(kSharedBytes<Team<1024>::kMostListed> <= 99 << 10, "what any later device has");

/// A tile without a vertex or a cell tells so and nothing else: whoever asks for its sums adds
/// nothing, and whoever asks for its rows finds no vertex there.
__device__ void pass_empty_tile(TileShared& s, const TileParams& p) {
  if (threadIdx.x != 0) return;
  publish_sum(p.order[s.item].vertices, s.item, 0);
  publish_sum(p.order[s.item].triangles, s.item, 0);
  s.number_base = 0;
  release_rows(s, p);
}

/// Counts a tile's crossing edges and active cells, and leaves their places. False where there
/// are none; the last tile, which tells what all have, goes on.
template <int N, bool Nan>
__device__ bool count_tile(TileShared& s, const TileParams& p) {
  count_rows<N>(s, [&](int y, int z, RowEdges& edges) {
    if constexpr (Nan) leave_out_nan(nan_rows_of(s), y, z, edges);
  });
  __syncthreads();
  if constexpr (Nan) clear_lists<N>(s);
  const SlabPlanes planes = planes_of<N>(s.item);
  const PlaneBases bases = PlaneBases::of(s, planes);
  const std::uint32_t vertices = bases.made<N>(s, planes);
  if (!Nan && vertices + bases.cells == 0 && s.item + 1 < s.items) {
    pass_empty_tile(s, p);
    __syncthreads();
    return false;
  }
  if (threadIdx.x == 0) {
    s.next_cells = s.next_vertices = 0;
    s.all_vertices = vertices;
    s.all_cells = bases.cells;
    publish_sum(p.order[s.item].vertices, s.item, s.all_vertices);
  }
  if constexpr (Nan) __syncthreads();  // the lists are empty
  publish_rows<N>(s, bases, planes, p.row_tables[s.tile.slot]);
  __syncthreads();
  return true;
}

/// The triangles of a tile with more cells than are listed at a time. The last
/// cells stay listed.
template <int N>
__device__ std::uint32_t count_in_turns(TileShared& s) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t cells = s.all_cells;
  std::uint32_t triangles = 0;
  for (std::uint32_t first = 0; first < cells; first += kListed) {
    if (first > 0) mark_cells<N>(s, first);
    const std::uint32_t listed = ::min(cells - first, kListed);
    find_cells<N>(s, listed);
    __syncthreads();
    triangles += triangles_before<N>(s, (listed + 31) / 32);
    __syncthreads();
  }
  return triangles;
}

/// Whether the warps of a tile wait for each other by named barriers. In those that take turns,
/// the turns' barriers are between them anyway.
template <int N, bool Nan>
__device__ bool wait_by_name(const TileShared& s) {
  return !Nan && ::max(s.all_cells, s.all_vertices) <= ListsOf<N>::kListed;
}

/// Finds the tile's cells and where its vertices and triangles go. Two warps ask what other
/// tiles know; the others wait for no more than the place of the vertices.
template <int N, bool Nan>
__device__ void find_places(TileShared& s, const TileParams& p) {
  const std::uint32_t cells = s.all_cells;
  const bool at_once = wait_by_name<N, Nan>(s);
  if (warp_id() == Team<N>::kVertices) {
    find_vertex_base(s, p);
    if (at_once) arrive<N, TeamBarrier::vertex_base>();
    if (lane_id() == 0) release_rows(s, p);
  }
  std::uint32_t triangles = 0;
  if (at_once) {
    find_cells<N>(s, cells);
  } else {
    triangles = count_in_turns<N>(s);
    // A tile with NaN, or a slab, may have vertices of cells of others only.
    if constexpr (Nan || Team<N>::kSlabs > 1) __syncthreads();
  }
  const bool for_vertices = warp_id() == Team<N>::kVertices,
             for_triangles = warp_id() == Team<N>::kTriangles;
  Neighbour neighbour{};
  if (for_vertices) neighbour = Neighbour::of_lane<N>(s, p);
  if (at_once) {
    // All wait for each other at this one, so nobody may do anything before it.
    if (!for_vertices && for_triangles) wait<N, TeamBarrier::vertex_base>();
    if (for_vertices || for_triangles)
      wait<N, TeamBarrier::cells>();
    else
      arrive<N, TeamBarrier::cells>();
    if (!for_vertices && !for_triangles) wait<N, TeamBarrier::vertex_base>();
  }
  if (for_triangles) {
    if (at_once) triangles = triangles_before<N>(s, (cells + 31) / 32);
    if (lane_id() == 0) {
      s.all_triangles = triangles;
      publish_sum(p.order[s.item].triangles, s.item, triangles);
    }
    find_triangle_base(s, p, triangles);
  }
  if (for_vertices) {
    ask_neighbours<N>(s, p, neighbour);
    if (at_once) arrive<N, TeamBarrier::neighbours>();
  }
}

template <int N, class T, bool Normals>
__device__ void emit_all_vertices(TileShared& s, const TileParams& p) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t vertices = s.all_vertices;
  if (s.vertex_base + vertices > p.vertex_capacity) return;
  for (std::uint32_t first = 0; first < vertices; first += kListed) {
    if (first > 0) mark_vertices<N>(s, first);
    emit_vertices<N, T, Normals>(s, p, first, ::min(vertices - first, kListed));
    if (vertices > kListed) __syncthreads();
  }
}

template <int N>
__device__ void emit_all_triangles(TileShared& s, const TileParams& p) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t cells = s.all_cells;
  std::uint64_t base = s.triangle_base;
  if (base + s.all_triangles > p.triangle_capacity) return;
  for (std::uint32_t first = 0; first < cells; first += kListed) {
    const std::uint32_t listed = ::min(cells - first, kListed);
    if (cells > kListed) {
      mark_cells<N>(s, first);
      find_cells<N>(s, listed);
      __syncthreads();
    }
    emit_triangles<N>(s, p, listed, base);
    if (cells > kListed) {
      base += triangles_before<N>(s, (listed + 31) / 32);
      __syncthreads();
    }
  }
}

/// Of a counted tile.
template <int N, class T, bool Normals, bool Nan>
__device__ void make_mesh_of_tile(TileShared& s, const TileParams& p) {
  find_places<N, Nan>(s, p);
  emit_all_vertices<N, T, Normals>(s, p);
  // After the vertices, which read the tile's samples once more. Wider samples of the tiles
  // in work fill the L2 cache alone, and would be driven out.
  if constexpr (sizeof(T) == 1 && Team<N>::kSlabs == 1)
    prefetch_tile<N, T>(s, p, s.item + gridDim.x);
  if (!wait_by_name<N, Nan>(s))
    __syncthreads();
  else if (warp_id() != Team<N>::kVertices)
    wait<N, TeamBarrier::neighbours>();
  number_at_0<N>(s);
  __syncthreads();
  borrow_rows<N>(s);
  place_numbers<N>(s);
  __syncthreads();
  emit_all_triangles<N>(s, p);
}

/// The last block to come here tells the host and leaves everything as the next launch
/// needs it.
template <int N>
__device__ void end_launch(TileShared& s, const TileParams& p) {
  const LaunchEnd& end = p.end;
  if (!end.report) return;
  if (threadIdx.x == 0)
    s.done_before = DeviceFlag(*end.done).fetch_add(1, cuda::memory_order_acq_rel);
  __syncthreads();
  if (s.done_before + 1 < gridDim.x) return;
  if (threadIdx.x == 0) {
    const SurfaceTotals made = s.items > 0 ? *p.totals : SurfaceTotals{};
    const std::uint32_t found = p.candidates.count > 0 ? s.items / Team<N>::kSlabs : *end.found;
    const auto say = [&](int i, std::uint64_t value) {
      cuda::atomic_ref<std::uint64_t, cuda::thread_scope_system>(end.report->words[i])
          .store(LaunchReport::word(value, end.launch), cuda::memory_order_relaxed);
    };
    say(0, made.vertices);
    say(1, made.triangles);
    say(2, found);
  }
  for (std::uint32_t i = own_thread(); i < end.zero_words; i += N) end.zero[i] = 0;
  if (p.candidates.count == 0) return;
  for (std::uint32_t i = own_thread(); i < s.items; i += N) p.order[i] = {0, 0};
}

template <int N, class T, bool Normals, bool Nan>
__global__ void __launch_bounds__(N, Team<N>::kTeams)
    extract_tiles(const __grid_constant__ TileParams p, const T threshold,
                  const std::uint16_t* __restrict__ case_entries) {
  extern __shared__ __align__(256) unsigned char bytes[];
  TileShared& s = *reinterpret_cast<TileShared*>(bytes);
  const std::uint32_t first = next_number(p);
  if (p.candidates.count > 0) find_candidates<N, T>(s, p);
  fill_tables<N>(s, case_entries);
  const Classifier<T> classifier(threshold);
  wait_for_launch_before();
  if (p.candidates.count == 0 && threadIdx.x == 0) s.items = *p.item_count;
  __syncthreads();
  take_tile<N, T>(s, p, first);
  __syncthreads();
  while (s.item < s.items) {
    if constexpr (Nan)
      find_nan<N, T>(s, p);
    else
      clear_lists<N>(s);
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
}

int device_attribute(cudaDeviceAttr attribute) {
  int device = 0, value = 0;
  check(cudaGetDevice(&device));
  check(cudaDeviceGetAttribute(&value, attribute, device));
  return value;
}

/// How many blocks fill the device, and how they are launched.
template <int N, class T, bool Normals, bool Nan = false>
struct Launcher {
  static constexpr auto kKernel = extract_tiles<N, T, Normals, Nan>;
  static constexpr int kSlabs = Team<N>::kSlabs;
  static std::size_t shared() {
    const bool before_ampere = device_attribute(cudaDevAttrComputeCapabilityMajor) < 8;
    return before_ampere ? kSharedBytes<kListedBeforeAmpere, Nan>
                         : kSharedBytes<Team<N>::kMostListed, Nan>;
  }
  /// 0 where the device has too little shared memory for one.
  static int blocks() {
    const std::size_t bytes = shared();
    if (static_cast<std::size_t>(device_attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin)) < bytes)
      return 0;
    check(cudaFuncSetAttribute(kKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                               static_cast<int>(bytes)));
    int each = 0;
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kKernel, N, bytes));
    return each * device_attribute(cudaDevAttrMultiProcessorCount);
  }
  /// Code for older devices does not wait by itself (wait_for_launch_before).
  static bool may_start_early() {
    cudaFuncAttributes attributes{};
    check(cudaFuncGetAttributes(&attributes, kKernel));
    return attributes.ptxVersion >= 90;
  }
  static void launch(const TileParams& params, const std::uint16_t* case_entries,
                     const LaunchShape& shape, cudaStream_t stream, bool start_early) {
    cudaLaunchAttribute early{};
    early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
    early.val.programmaticStreamSerializationAllowed = 1;
    cudaLaunchConfig_t config{};
    config.gridDim = static_cast<unsigned>(shape.blocks);
    config.blockDim = N;
    config.dynamicSmemBytes = shape.shared_bytes;
    config.stream = stream;
    config.attrs = &early;
    config.numAttrs = start_early ? 1 : 0;
    check(cudaLaunchKernelEx(&config, kKernel, params, Threshold<T>(params.isovalue).value,
                             case_entries));
    check_launch("extract_tiles");
  }
};

template <int N, class F>
auto visit_launcher_of(ScalarType type, bool normals, F&& f) {
  return visit_device_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return normals ? f(Launcher<N, T, true>()) : f(Launcher<N, T, false>());
  });
}

/// Numbers of threads that have kernels for everything but NaN, and others for bytes
/// without normals only.
constexpr int kTeams[3] = {1024, 640, 384}, kByteTeams[5] = {32, 64, 128, 256, 512};
constexpr int kNanTeam = 384;

template <class F>
auto visit_launcher(const TileKernel& kernel, int threads, F&& f) {
  const auto [type, normals, nan] = kernel;
  using Byte = std::uint8_t;
  if (nan)
    return normals ? f(Launcher<kNanTeam, float, true, true>())
                   : f(Launcher<kNanTeam, float, false, true>());
  switch (threads) {
    case 32: return f(Launcher<32, Byte, false>());
    case 64: return f(Launcher<64, Byte, false>());
    case 128: return f(Launcher<128, Byte, false>());
    case 256: return f(Launcher<256, Byte, false>());
    case 512: return f(Launcher<512, Byte, false>());
    case kSlabTeam: return visit_launcher_of<kSlabTeam>(type, normals, f);
    case 640: return visit_launcher_of<640>(type, normals, f);
    case 1024: return visit_launcher_of<1024>(type, normals, f);
    default: return visit_launcher_of<384>(type, normals, f);
  }
}

void check_threads(const TileKernel& kernel, int threads) {
  for (const int known : kTeams)
    if (threads == known && (!kernel.may_have_nan || known == kNanTeam)) return;
  for (const int known : kByteTeams)
    if (threads == known && kernel.type == ScalarType::u8 && !kernel.normals) return;
  throw UsageError(
      "384, 640 or 1024 threads share a tile, where there may be NaN 384, and for u8 without "
      "normals also 32, 64, 128, 256 or 512");
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

LaunchShapes launch_shapes(const TileKernel& kernel, int threads) {
  if (threads > 0) check_threads(kernel, threads);
  const auto shape_of = [&](int team) {
    return visit_launcher(kernel, team, [&](auto l) {
      return LaunchShape{l.blocks(), team, l.kSlabs, l.shared(), l.may_start_early()};
    });
  };
  LaunchShapes shapes;
  for (int i = 0; i < 3; ++i)
    shapes.shapes[i] = shape_of(threads > 0 ? threads : kernel.may_have_nan ? kNanTeam : kTeams[i]);
  if (threads == 0 && !kernel.may_have_nan) shapes.slabs = shape_of(kSlabTeam);
  if (shapes.shapes[2].blocks == 0)
    throw Error("the device has too little shared memory for the extraction kernel");
  return shapes;
}

LaunchShape LaunchShapes::of(std::uint32_t tiles) const {
  const auto threads_at_work = [](const LaunchShape& s) { return s.blocks * s.threads; };
  const LaunchShape* best = &shapes[2];
  // Where shared memory is scarce, a larger team keeps more threads at work.
  for (const LaunchShape& shape : shapes)
    if (threads_at_work(shape) > 2 * threads_at_work(*best)) best = &shape;
  for (const LaunchShape& shape : shapes)
    if (shape.blocks > 0 && tiles <= static_cast<std::uint32_t>(shape.blocks)) return shape;
  return *best;
}

LaunchShape LaunchShapes::in_slabs(std::uint32_t tiles) const {
  const auto blocks = static_cast<std::uint32_t>(slabs.blocks);
  return blocks > 0 && tiles * kSlabsOfTile <= blocks ? slabs : of(tiles);
}

void launch_extraction(const TileKernel& kernel, const TileParams& params,
                       const std::uint16_t* case_entries, LaunchShape shape, cudaStream_t stream,
                       bool after_search) {
  visit_launcher(kernel, shape.threads, [&](auto l) {
    l.launch(params, case_entries, shape, stream, after_search && shape.may_start_early);
  });
}

}  // namespace isobrick::gpu

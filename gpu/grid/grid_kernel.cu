#include "gpu/grid/grid_kernel.h"

#include <cub/block/block_scan.cuh>
#include <type_traits>

#include "gpu/memory/cuda_check.h"
#include "surface/grid_math.h"

namespace isobrick::inline v0::gpu {
namespace {

/// That make the values of a grid.
constexpr unsigned kBlocksOfValues = 32;
constexpr int kThreads = 256, kWarps = kThreads / 32, kScanThreads = 1024;
constexpr unsigned kFullMask = 0xffffffffu;

static_assert(sizeof(GridWork) % 4 == 0 && std::is_trivially_copyable_v<GridWork>);

/// Memory of a block for the grid that it is for.
struct WorkStorage {
  alignas(GridWork) unsigned words[sizeof(GridWork) / 4];
};

/// The block's grid, copied: writing the mesh does not mean reading it again.
__device__ const GridWork& load_work(const GridWork* works, WorkStorage& storage) {
  const auto* from = reinterpret_cast<const unsigned*>(works + blockIdx.y);
  for (unsigned i = threadIdx.x; i < sizeof(GridWork) / 4; i += blockDim.x)
    storage.words[i] = from[i];
  __syncthreads();
  return *reinterpret_cast<const GridWork*>(storage.words);
}

__device__ std::uint64_t below(int count) {
  return count >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
}

template <class T>
__device__ void make_values(const GridView& g) {
  const int count = g.around_n[0] * g.around_n[1] * g.around_n[2];
  const T* from = static_cast<const T*>(g.stored.samples);
  // Of this grid only: nothing else reads or writes there meanwhile.
  auto* to = const_cast<float*>(g.around);
  for (int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x); i < count;
       i += static_cast<int>(gridDim.x * blockDim.x))
    to[i] = point_value(from[i], g.stored.isovalue);
}

__global__ void __launch_bounds__(kThreads) make_values(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridView& g = load_work(works, storage).grid;
  if (g.stored.samples == nullptr) return;
  switch (g.stored.type) {
    case ScalarType::u8: return make_values<std::uint8_t>(g);
    case ScalarType::i8: return make_values<std::int8_t>(g);
    case ScalarType::u16: return make_values<std::uint16_t>(g);
    case ScalarType::i16: return make_values<std::int16_t>(g);
    default: return;  // larger ones are not stored
  }
}

/// The row that a warp is for, and its lane.
struct Warp {
  int row, lane;
  __device__ Warp()
      : row(static_cast<int>(blockIdx.x) * kWarps + static_cast<int>(threadIdx.x) / 32),
        lane(static_cast<int>(threadIdx.x) % 32) {}
};

__device__ int rows_of(const GridView& g) { return g.n[1] * g.n[2]; }

/// One bit for each of 65 values.
template <class F>
__device__ void ballot(const float* values, int count, int lane, F&& pass,
                       std::uint64_t (&bits)[2]) {
  const auto part = [&](int first) {
    const int x = first + lane;
    return __ballot_sync(kFullMask, x < count && pass(values[x]));
  };
  const unsigned a = part(0), b = part(32), c = part(64);
  bits[0] = a | static_cast<std::uint64_t>(b) << 32;
  bits[1] = c;
}

__global__ void __launch_bounds__(kThreads) find_inside(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const Warp warp;
  if (warp.row >= rows_of(w.grid)) return;
  const float* values = w.grid.at(0, warp.row % w.grid.n[1], warp.row / w.grid.n[1]);
  std::uint64_t inside[2], number[2];
  ballot(
      values, w.grid.n[0], warp.lane, [](float v) { return v >= 0; }, inside);
  ballot(
      values, w.grid.n[0], warp.lane, [](float v) { return v == v; }, number);
  if (warp.lane != 0) return;
  GridRow& row = w.rows[warp.row];
  for (int i = 0; i < 2; ++i) {
    row.inside[i] = inside[i];
    row.number[i] = number[i];
  }
}

/// The cells above a row of points that have triangles, and their corners: rows at (y, z), (y +
/// 1, z), (y, z + 1), (y + 1, z + 1), bit x of each at x and at x + 1.
struct Cells {
  std::uint64_t active = 0;
  std::uint64_t low[4], high[4];

  __device__ Cells(const GridWork& w, int row) {
    const GridView& g = w.grid;
    const int y = row % g.n[1], z = row / g.n[1];
    if (y + 1 >= g.n[1] || z + 1 >= g.n[2]) return;
    const int rows[4] = {row, row + 1, row + g.n[1], row + g.n[1] + 1};
    std::uint64_t any = 0, all = ~std::uint64_t{0}, whole = below(g.n[0] - 1);
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const GridRow& r = w.rows[rows[i]];
      low[i] = r.inside[0];
      high[i] = low[i] >> 1 | r.inside[1] << 63;
      any |= low[i] | high[i];
      all &= low[i] & high[i];
      whole &= r.number[0] & (r.number[0] >> 1 | r.number[1] << 63);
    }
    active = any & ~all & whole;
  }
  __device__ unsigned index(int x) const {
    unsigned index = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i)
      index |=
          (static_cast<unsigned>(low[i] >> x & 1) | static_cast<unsigned>(high[i] >> x & 1) << 1)
          << (2 * i);
    return index;
  }
};

/// Active edges, and how many vertices and triangles that makes.
__global__ void __launch_bounds__(kThreads) count_rows(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const int at = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const GridView& g = w.grid;
  if (at >= rows_of(g)) return;
  GridRow& row = w.rows[at];
  const int y = at % g.n[1], z = at / g.n[1];
  const auto across = [&](const GridRow& other, int i) {
    return (row.inside[i] ^ other.inside[i]) & row.number[i] & other.number[i];
  };
  const std::uint64_t next = row.inside[0] >> 1 | row.inside[1] << 63;
  const std::uint64_t next_number = row.number[0] >> 1 | row.number[1] << 63;
  row.active_edges[0][0] = (row.inside[0] ^ next) & row.number[0] & next_number & below(g.n[0] - 1);
  row.active_edges[0][1] = 0;
  unsigned vertices = 0, triangles = 0;
  for (int i = 0; i < 2; ++i) {
    row.active_edges[1][i] = y + 1 < g.n[1] ? across(w.rows[at + 1], i) : 0;
    row.active_edges[2][i] = z + 1 < g.n[2] ? across(w.rows[at + g.n[1]], i) : 0;
  }
  for (int axis = 0; axis < 3; ++axis)
    vertices += static_cast<unsigned>(__popcll(row.active_edges[axis][0])) +
                static_cast<unsigned>(row.active_edges[axis][1]);
  const Cells cells(w, at);
  for (std::uint64_t left = cells.active; left != 0; left &= left - 1)
    triangles += w.tables->triangles[cells.index(__ffsll(static_cast<long long>(left)) - 1)];
  w.counts[at] = vertices;
  w.counts[kGridRows + at] = triangles;
}

/// Calls put(row, sums of both counts in rows before), by one block; the sums of all.
template <class F>
__device__ uint2 scan_rows(int rows, const std::uint32_t* first, const std::uint32_t* second,
                           F&& put) {
  using Scan = cub::BlockScan<unsigned long long, kScanThreads>;
  __shared__ typename Scan::TempStorage storage;
  unsigned long long before = 0;
  for (int base = 0; base < rows; base += kScanThreads) {
    const int row = base + static_cast<int>(threadIdx.x);
    unsigned long long mine = 0, sum = 0, all = 0;
    if (row < rows) mine = first[row] | static_cast<unsigned long long>(second[row]) << 32;
    Scan(storage).ExclusiveSum(mine, sum, all);
    sum += before;
    before += all;
    if (row < rows) put(row, static_cast<unsigned>(sum), static_cast<unsigned>(sum >> 32));
    __syncthreads();
  }
  return {static_cast<unsigned>(before), static_cast<unsigned>(before >> 32)};
}

__global__ void __launch_bounds__(kScanThreads) number_rows(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const uint2 all = scan_rows(rows_of(w.grid), w.counts, w.counts + kGridRows,
                              [&](int at, unsigned vertices, unsigned triangles) {
                                GridRow& row = w.rows[at];
                                for (int axis = 0; axis < 3; ++axis) {
                                  row.first_vertex[axis] = vertices;
                                  vertices +=
                                      static_cast<unsigned>(__popcll(row.active_edges[axis][0])) +
                                      static_cast<unsigned>(row.active_edges[axis][1]);
                                }
                                row.first_triangle = triangles;
                              });
  if (threadIdx.x == 0) *w.host_totals = *w.totals = {all.x, all.y, 0, 0};
}

/// Calls f(here, x, number) for the edges along `axis` from a row's points, by one warp: all
/// lanes at a time, in ascending order; `here`: the lane's edge crosses.
template <int axis, class F>
__device__ void for_each_edge(const GridRow& row, int lane, int points, F&& f) {
  for (int first = 0; first < points; first += 32) {
    const int x = first + lane;
    const bool here = x < 64 ? (row.active_edges[axis][0] >> x & 1) != 0
                             : x == 64 && row.active_edges[axis][1] != 0;
    const int rank = __popcll(row.active_edges[axis][0] & below(x));
    f(here, x, row.first_vertex[axis] + static_cast<unsigned>(rank));
  }
}

/// On which faces with coarser grids vertices lie, and how many in each row lie on any.
__global__ void __launch_bounds__(kThreads) find_borders(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const Warp warp;
  const GridView& g = w.grid;
  if (!w.meets_coarser || warp.row >= rows_of(g)) return;
  const int y = warp.row % g.n[1], z = warp.row / g.n[1];
  const GridRow& row = w.rows[warp.row];
  unsigned count = 0;
  const auto flag = [&](bool here, unsigned number, unsigned faces) {
    if (here) w.faces[number] = static_cast<std::uint8_t>(faces);
    count += static_cast<unsigned>(__popc(__ballot_sync(kFullMask, here && faces != 0)));
  };
  for_each_edge<0>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    flag(here, number, here ? grid::place_on<0>(g, x, y, z).faces(g) : 0u);
  });
  for_each_edge<1>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    flag(here, number, here ? grid::place_on<1>(g, x, y, z).faces(g) : 0u);
  });
  for_each_edge<2>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    flag(here, number, here ? grid::place_on<2>(g, x, y, z).faces(g) : 0u);
  });
  if (warp.lane == 0) w.counts[2 * kGridRows + warp.row] = count;
}

/// The sum of `value` in lanes before.
__device__ unsigned sum_before(unsigned value, int lane, unsigned& all) {
  unsigned sum = value;
  for (int step = 1; step < 32; step *= 2) {
    const unsigned other = __shfl_up_sync(kFullMask, sum, step);
    if (lane >= step) sum += other;
  }
  all = __shfl_sync(kFullMask, sum, 31);
  return sum - value;
}

/// The number of the vertex on an edge of the cell at x above a row of points.
__device__ unsigned vertex_number(const GridWork& w, int row, int x, int edge) {
  const int axis = edge >> 2, low = edge & 1, high = edge >> 1 & 1, plane = w.grid.n[1];
  const int at = row + (axis == 0 ? low + high * plane : axis == 1 ? high * plane : high);
  const int from = axis == 0 ? x : x + low;
  const GridRow& r = w.rows[at];
  return r.first_vertex[axis] +
         static_cast<unsigned>(__popcll(r.active_edges[axis][0] & below(from)));
}

__device__ Triangle triangle_of(const GridWork& w, int row, int x, unsigned index, int t) {
  const std::uint8_t* edges = w.tables->edges[index].data() + 3 * t;
  return {vertex_number(w, row, x, edges[0]), vertex_number(w, row, x, edges[1]),
          vertex_number(w, row, x, edges[2])};
}

/// How many of a cell's triangles' sides lie on faces with coarser grids.
__device__ unsigned sides_of(const GridWork& w, int row, int x, unsigned index) {
  unsigned sides = 0;
  for (int t = 0; t < w.tables->triangles[index]; ++t) {
    const Triangle v = triangle_of(w, row, x, index, t);
    for (int k = 0; k < 3; ++k) sides += (w.faces[v[k]] & w.faces[v[(k + 1) % 3]]) != 0;
  }
  return sides;
}

__global__ void __launch_bounds__(kThreads) count_seams(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const Warp warp;
  if (!w.meets_coarser || warp.row >= rows_of(w.grid)) return;
  const Cells cells(w, warp.row);
  unsigned sides = 0;
  for (int x = warp.lane; x < 64; x += 32)
    if (cells.active >> x & 1) sides += sides_of(w, warp.row, x, cells.index(x));
  unsigned all = 0;
  sum_before(sides, warp.lane, all);
  if (warp.lane == 0) w.counts[3 * kGridRows + warp.row] = all;
}

__global__ void __launch_bounds__(kScanThreads) number_seam_strips(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  if (!w.meets_coarser) return;
  const uint2 all = scan_rows(rows_of(w.grid), w.counts + 2 * kGridRows, w.counts + 3 * kGridRows,
                              [&](int at, unsigned vertices, unsigned sides) {
                                w.rows[at].border_vertices = vertices;
                                w.rows[at].seam_sides = sides;
                              });
  if (threadIdx.x == 0) {
    w.totals->border_vertices = all.x;
    w.totals->seam_sides = all.y;
    *w.host_totals = *w.totals;
  }
}

__device__ bool fits(const GridWork& w) {
  const GridTotals& t = *w.totals;
  return t.vertices + 2 * t.border_vertices <= w.vertex_room &&
         t.triangles + 2 * t.seam_sides <= w.triangle_room;
}

__global__ void __launch_bounds__(kThreads) write_vertices(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const Warp warp;
  const GridView& g = w.grid;
  if (warp.row >= rows_of(g) || !fits(w)) return;
  const int y = warp.row % g.n[1], z = warp.row / g.n[1];
  const GridRow& row = w.rows[warp.row];
  unsigned border = w.meets_coarser ? row.border_vertices : 0;
  const auto put = [&](bool here, unsigned number, const grid::Vertex& vertex) {
    if (here) {
      w.positions[number] = vertex.position;
      w.normals[number] = vertex.normal;
    }
    if (w.meets_coarser) {
      const bool on = here && vertex.faces != 0;
      const unsigned mask = __ballot_sync(kFullMask, on);
      if (on) {
        const auto before = static_cast<unsigned>(__popc(mask & ((1u << warp.lane) - 1)));
        const unsigned beside = w.totals->vertices + 2 * (border + before);
        w.seam_of[number] = beside;
        w.positions[beside] = grid::beside(vertex.position, vertex.normal, g.seam_strip);
        w.positions[beside + 1] = grid::beside(vertex.position, vertex.normal, -g.seam_strip);
        w.normals[beside] = w.normals[beside + 1] = vertex.normal;
      }
      border += static_cast<unsigned>(__popc(mask));
    }
  };
  for_each_edge<0>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    put(here, number, here ? grid::vertex_on<0>(g, x, y, z) : grid::Vertex{});
  });
  for_each_edge<1>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    put(here, number, here ? grid::vertex_on<1>(g, x, y, z) : grid::Vertex{});
  });
  for_each_edge<2>(row, warp.lane, g.n[0], [&](bool here, int x, unsigned number) {
    put(here, number, here ? grid::vertex_on<2>(g, x, y, z) : grid::Vertex{});
  });
}

__global__ void __launch_bounds__(kThreads) write_triangles(const GridWork* works) {
  __shared__ WorkStorage storage;
  const GridWork& w = load_work(works, storage);
  const Warp warp;
  if (warp.row >= rows_of(w.grid) || !fits(w)) return;
  const Cells cells(w, warp.row);
  if (cells.active == 0) return;
  const GridRow& row = w.rows[warp.row];
  unsigned next = row.first_triangle, side = w.meets_coarser ? row.seam_sides : 0, all = 0;
  for (int x = warp.lane; x < 64; x += 32) {
    const bool here = (cells.active >> x & 1) != 0;
    const unsigned index = here ? cells.index(x) : 0;
    const unsigned count = w.tables->triangles[index];
    unsigned at = next + sum_before(count, warp.lane, all);
    next += all;
    unsigned seam_strip = 0;
    if (w.meets_coarser) {
      const unsigned sides = here ? sides_of(w, warp.row, x, index) : 0;
      seam_strip = w.totals->triangles + 2 * (side + sum_before(sides, warp.lane, all));
      side += all;
    }
    for (int t = 0; t < static_cast<int>(count); ++t) {
      const Triangle v = triangle_of(w, warp.row, x, index, t);
      w.triangles[at++] = v;
      if (w.meets_coarser)
        for (int k = 0; k < 3; ++k) {
          const unsigned a = v[k], b = v[(k + 1) % 3];
          if ((w.faces[a] & w.faces[b]) == 0) continue;
          const unsigned ra = w.seam_of[a], rb = w.seam_of[b];
          w.triangles[seam_strip++] = {ra, rb, rb + 1};
          w.triangles[seam_strip++] = {ra, rb + 1, ra + 1};
        }
    }
  }
}

}  // namespace

void launch_grid_values(const GridBatchWork& batch, cudaStream_t stream) {
  if (!batch.any_stored) return;
  make_values<<<dim3(kBlocksOfValues, static_cast<unsigned>(batch.count)), kThreads, 0, stream>>>(
      batch.works);
  check_launch("the values of grids");
}

void launch_grid_count(const GridBatchWork& batch, cudaStream_t stream) {
  const auto grids = static_cast<unsigned>(batch.count);
  const auto rows = static_cast<unsigned>(batch.max_rows);
  const dim3 warps((rows + kWarps - 1) / kWarps, grids), threads((rows + 127) / 128, grids);
  find_inside<<<warps, kThreads, 0, stream>>>(batch.works);
  count_rows<<<threads, 128, 0, stream>>>(batch.works);
  number_rows<<<dim3(1, grids), kScanThreads, 0, stream>>>(batch.works);
  if (batch.any_meets_coarser) {
    find_borders<<<warps, kThreads, 0, stream>>>(batch.works);
    count_seams<<<warps, kThreads, 0, stream>>>(batch.works);
    number_seam_strips<<<dim3(1, grids), kScanThreads, 0, stream>>>(batch.works);
  }
  check_launch("counting the meshes of grids");
}

void launch_grid_mesh(const GridBatchWork& batch, cudaStream_t stream) {
  const dim3 warps((static_cast<unsigned>(batch.max_rows) + kWarps - 1) / kWarps,
                   static_cast<unsigned>(batch.count));
  write_vertices<<<warps, kThreads, 0, stream>>>(batch.works);
  write_triangles<<<warps, kThreads, 0, stream>>>(batch.works);
  check_launch("the meshes of grids");
}

}  // namespace isobrick::gpu

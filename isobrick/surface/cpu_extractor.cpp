#include "isobrick/surface/cpu_extractor.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/surface/boundary_map.h"
#include "isobrick/surface/tile_gather.h"
#include "isobrick/surface/tile_kernels.h"

namespace isobrick {
namespace {

/// Tiles that a thread takes between two hand-offs: about a million cells, so
/// that a hand-off costs nothing, and a work space that stays in the L2 cache.
constexpr std::size_t kTilesPerThread = 32;

WorldMap world_map(const Transform& t) {
  WorldMap map;
  for (int row = 0; row < 3; ++row) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(3 * row + axis);
      map.m[i] = static_cast<float>(t.direction[i] * t.spacing[axis]);
      map.normal[i] = static_cast<float>(t.direction[i] / t.spacing[axis]);
    }
    map.origin[row] = static_cast<float>(t.origin[row]);
  }
  return map;
}

}  // namespace

Index sample_reach(const SurfaceOptions& options) {
  return options.normals || options.may_have_nan ? 1 : 0;
}

struct CpuExtractor::Impl {
  Lattice lattice;
  SurfaceOptions options;
  KernelContext context;
  Int3 first_tile;
  BoundaryMap boundaries;
  std::vector<std::unique_ptr<TileState>> states;
  std::uint64_t vertices = 0, triangles = 0;

  Impl(const Lattice& l, const SurfaceOptions& o)
      : lattice(l), options(o) {
    options.roi = intersect(o.roi, l.box());
    if (std::isnan(o.isovalue)) throw UsageError("the isovalue is not a number");
    if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
    options.may_have_nan = o.may_have_nan && is_floating(l.type);
    context = {o.isovalue, world_map(o.transform), o.normals, options.may_have_nan, l.extent,
               options.roi};
    first_tile = tile_of(options.roi.lo);
  }

  static Int3 tile_of(Int3 p) { return {p.x / kTileEdge, p.y / kTileEdge, p.z / kTileEdge}; }

  bool welded() const { return options.indexing == Indexing::welded; }

  /// False when the region of interest leaves the tile no cell.
  bool shape_tile(TileShape& shape, Int3 tile) const {
    shape.origin = tile * kTileEdge;
    for (int axis = 0; axis < 3; ++axis) {
      const Index lo = std::max<Index>(options.roi.lo[axis] - shape.origin[axis], 0);
      const Index hi = std::min(options.roi.hi[axis] - 1 - shape.origin[axis], kTileEdge);
      if (hi <= lo) return false;
      shape.lo[axis] = static_cast<int>(lo);
      shape.hi[axis] = static_cast<int>(hi);
      shape.first[axis] = !welded() || tile[axis] == first_tile[axis];
    }
    return true;
  }

  void count(TileState& state, const TileWork& work, const BrickLookup& bricks) {
    state.work = work;
    state.vertices = state.triangles = 0;
    state.cells.clear();
    if (!shape_tile(state.shape, work.tile)) {
      for (EdgeRow& row : state.rows) row = {};
    } else {
      if (options.may_have_nan) state.work.active_blocks = 0xff;
      gather_tile(lattice, bricks, options.fill_value, sample_reach(options), state);
      scan_tile(lattice.type, context, state);
    }
    if (welded()) publish_boundary(state);
  }

  /// Gives every tile of a batch its place behind what is there; the totals.
  std::pair<std::uint64_t, std::uint64_t> place(std::size_t batch) {
    std::uint64_t v = 0, t = 0;
    for (std::size_t i = 0; i < batch; ++i) {
      TileState& state = *states[i];
      state.vertex_base = v;
      state.triangle_base = t;
      v += state.vertices;
      t += state.triangles;
      if (state.boundary) state.boundary->base = static_cast<std::uint32_t>(vertices + state.vertex_base);
    }
    if (welded() && vertices + v > std::numeric_limits<std::uint32_t>::max())
      throw Error("the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits "
                  "cannot number; extract it in parts with --roi, or as STL");
    return {v, t};
  }

  template <class F>
  static void for_each_tile(std::size_t batch, bool parallel, const F& f) {
    if (!parallel) {
      for (std::size_t i = 0; i < batch; ++i) f(i);
      return;
    }
    tbb::parallel_for(std::size_t{0}, batch, f);
  }

  void extract_batch(std::span<const TileWork> tiles, const BrickLookup& bricks, MeshBuffer& out) {
    const std::size_t n = tiles.size();
    while (states.size() < n) states.push_back(std::make_unique<TileState>());
    for (std::size_t i = 0; i < n; ++i)
      states[i]->boundary = welded() ? boundaries.add(tiles[i].tile) : nullptr;
    const bool parallel = n > kTilesPerThread;
    for_each_tile(n, parallel, [&](std::size_t i) { count(*states[i], tiles[i], bricks); });
    const auto [v, t] = place(n);
    const std::size_t old_vertices = out.positions.size(), old_triangles = out.triangles.size();
    out.positions.resize(old_vertices + v);
    if (options.normals) out.normals.resize(old_vertices + v);
    out.triangles.resize(old_triangles + t);
    const std::uint64_t first_number = welded() ? vertices : old_vertices;
    for_each_tile(n, parallel, [&](std::size_t i) {
      TileState& state = *states[i];
      if (state.vertices == 0 && state.triangles == 0) return;
      adopt_boundaries(state, boundaries,
                       static_cast<std::uint32_t>(first_number + state.vertex_base));
      const std::size_t at = old_vertices + state.vertex_base;
      emit_tile(lattice.type, context, state, out.positions.data() + at,
                options.normals ? out.normals.data() + at : nullptr,
                out.triangles.data() + old_triangles + state.triangle_base);
    });
    vertices += v;
    triangles += t;
    if (welded()) boundaries.forget_before(tiles.back().tile);
  }
};

CpuExtractor::CpuExtractor(const Lattice& lattice, const SurfaceOptions& options)
    : impl_(std::make_unique<Impl>(lattice, options)) {}
CpuExtractor::~CpuExtractor() = default;

void CpuExtractor::extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
                           MeshBuffer& out) {
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  while (!tiles.empty()) {
    const std::size_t batch = std::min(tiles.size(), kTilesPerThread * threads);
    impl_->extract_batch(tiles.first(batch), bricks, out);
    tiles = tiles.subspan(batch);
  }
}

void CpuExtractor::restart() {
  impl_->boundaries.clear();
  impl_->vertices = impl_->triangles = 0;
}

std::uint64_t CpuExtractor::vertices() const { return impl_->vertices; }
std::uint64_t CpuExtractor::triangles() const { return impl_->triangles; }

std::uint64_t CpuExtractor::workspace_bytes(ScalarType type, int threads) {
  return static_cast<std::uint64_t>(threads) * kTilesPerThread *
         (sizeof(TileState) + TileLayout::kSize * size_of(type) +
          kTileEdge * kTileEdge * kTileEdge * sizeof(ActiveCell));
}

}  // namespace isobrick

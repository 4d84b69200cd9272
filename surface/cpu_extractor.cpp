#include "surface/cpu_extractor.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/morton.h"
#include "core/stopwatch.h"
#include "surface/boundary_map.h"
#include "surface/cap.h"
#include "surface/case_rule.h"
#include "surface/chunk_writer.h"
#include "surface/coincident_vertices.h"
#include "surface/patched_cells.h"
#include "surface/sample_vertices.h"
#include "surface/tile_kernels.h"
#include "surface/tile_samples.h"
#include "surface/world_map.h"

namespace isobrick::inline v0 {
namespace {

/// Tiles that a thread takes between two hand-offs: enough for a hand-off to cost little, and
/// few enough for their samples and work spaces to stay in a core's cache.
constexpr std::size_t kTilesPerThread = 8;

/// Of a tile's boundary, mostly: few surfaces cross its upper x face so often that the lists of
/// vertices there take more.
std::uint64_t boundary_bytes_of_tile(bool drop_degenerate, const CapBounds& cap) {
  // Any sample on a tile's six planes may be a coincident vertex.
  constexpr std::uint64_t inner = kTileSamples - 2;
  constexpr std::uint64_t planes = kTileSamples * kTileRows - inner * inner * inner;
  return 3072 + (drop_degenerate ? planes : cap.shared) * sizeof(SharedSample);
}

/// Edges of a tile: three from each sample.
constexpr std::uint64_t kMaxEdges = std::uint64_t{3} * kTileRows * kTileSamples;

/// A tile takes some 50 µs and a hand-off some 10: fewer tiles stay on one thread.
constexpr std::size_t kWorthThreads = 6;

}  // namespace

TileWorkSpaces::TileWorkSpaces() = default;
TileWorkSpaces::~TileWorkSpaces() = default;

struct CpuExtractor::Impl {
  Lattice lattice;
  SurfaceOptions options;
  ExtractorLimits limits;
  KernelContext context;
  Int3 first_tile;
  BoundaryMap boundaries;
  std::shared_ptr<TileWorkSpaces> spaces;
  std::vector<std::unique_ptr<TileState>>& states;
  Mesh mesh;  ///< not handed on
  SurfaceReport made;
  std::optional<ChunkWriter> writer;
  TileRange part;
  TilePlaces* places = nullptr;  ///< of a part of a mesh
  MeshSize before;               ///< of the tiles before the part

  Impl(const Lattice& l, const SurfaceOptions& o, ExtractorLimits bounds, MeshSink* sink,
       std::shared_ptr<TileWorkSpaces> work_spaces)
      : lattice(l),
        options(o),
        limits(bounds),
        boundaries(l.tiles()),
        spaces(work_spaces ? std::move(work_spaces) : std::make_shared<TileWorkSpaces>()),
        states(spaces->states_) {
    // An extraction of a larger budget may have left more.
    if (states.size() > limits.tiles) states.resize(limits.tiles);
    options.roi = intersect(o.roi, l.box());
    if (std::isnan(o.isovalue)) throw UsageError("the isovalue is not a number");
    if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
    options.may_have_nan = o.may_have_nan && is_floating(l.type);
    options.drop_degenerate = o.drop_degenerate && has_coincident(l.type, o.isovalue);
    context = {.isovalue = o.isovalue,
               .world = world_map(o.transform, o.inside),
               .normals = o.normals,
               .may_have_nan = options.may_have_nan,
               .extent = l.extent,
               .roi = options.roi,
               .trilinear = o.topology == Topology::trilinear,
               .cap = o.cap,
               .inside = o.inside,
               .border = options.roi};
    first_tile = tile_of(options.roi.lo);
    if (sink) writer.emplace(*sink);
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

  void gather(TileState& state, const TileSamples& samples) const {
    state.samples.resize(TileLayout::kSize * lattice.sample_bytes());
    samples.gather(
        state.work, sample_reach(options),
        {state.samples.data(), TileLayout::kOrigin, TileLayout::kRow, TileLayout::kPlane});
  }

  void count(TileState& state, const TileWork& work, const TileSamples& samples) const {
    count(state, work, samples, context);
  }

  void count(TileState& state, const TileWork& work, const TileSamples& samples,
             const KernelContext& kernels) const {
    state.work = work;
    state.vertices = state.triangles = 0;
    state.cells.clear();
    state.clear_patched();
    // Another extractor may have left its own, or none.
    if (options.drop_degenerate != (state.coincident != nullptr))
      state.coincident = options.drop_degenerate ? std::make_unique<CoincidentVertices>() : nullptr;
    if (options.cap != (state.cap != nullptr))
      state.cap = options.cap ? std::make_unique<TileCap>() : nullptr;
    const bool on_samples = options.drop_degenerate || options.cap;
    if (on_samples != (state.on_samples != nullptr))
      state.on_samples = on_samples ? std::make_unique<SampleVertices>() : nullptr;
    if (on_samples) state.on_samples->clear();
    if (!shape_tile(state.shape, work.tile)) {
      state.clear_rows();
      if (state.coincident) state.coincident->clear();
      if (state.cap) state.cap->clear();
    } else {
      if (options.may_have_nan) state.work.active_blocks = 0xff;
      gather(state, samples);
      count_tile(lattice.type, kernels, state);
      if (kernels.trilinear) count_patched_cells(lattice.type, kernels, state);
      if (state.coincident) count_coincident(state);
      if (state.cap) count_cap(lattice.type, kernels, state);
      if (on_samples) list_sample_vertices(lattice.type, kernels, !welded(), state);
    }
    if (!state.boundary) return;
    publish_boundary(state);
    if (on_samples) publish_sample_vertices(kernels, state);
  }

  template <class F>
  static void for_each_tile(std::size_t begin, std::size_t end, const F& f) {
    if (end - begin < kWorthThreads)
      for (std::size_t i = begin; i < end; ++i) f(i);
    else
      tbb::parallel_for(begin, end, f, tbb::simple_partitioner());
  }

  void note_place(const TileState& state) {
    if (!places) return;
    const std::uint32_t left_out = state.coincident ? state.coincident->left_out : 0;
    if (state.vertices > 0 || state.triangles > 0 || left_out > 0)
      places->place({morton_encode(state.work.tile), state.number_base, state.vertices,
                     state.triangles, left_out});
  }

  void check_numbers() const {
    if (welded() && made.vertices > std::numeric_limits<std::uint32_t>::max())
      throw Error(
          "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits "
          "cannot number; extract it by way of pieces (--resume), by regions (--roi) or as STL");
  }

  /// Gives the counted tiles from `begin` on their places in the mesh, as many as
  /// the limits allow; the first that did not fit.
  std::size_t place(std::size_t begin, std::size_t count) {
    std::uint64_t v = mesh.positions.size(), t = mesh.triangles.size();
    std::size_t i = begin;
    for (; i < count; ++i) {
      TileState& state = *states[i];
      if (writer && v > 0 &&
          mesh_bytes({v + state.vertices, t + state.triangles}, options.normals) >
              limits.output_bytes)
        break;
      state.vertex_base = v;
      state.triangle_base = t;
      state.number_base = static_cast<std::uint32_t>(welded() ? made.vertices : v);
      if (state.boundary) state.boundary->base = state.number_base;
      v += state.vertices;
      t += state.triangles;
      made.vertices += state.vertices;
      made.triangles += state.triangles;
      if (state.coincident) made.degenerate_triangles += state.coincident->left_out;
      note_place(state);
    }
    check_numbers();
    return i;
  }

  void write(TileState& state) {
    if (state.vertices == 0 && state.triangles == 0) return;
    adopt_boundaries(state, boundaries);
    if (state.on_samples) adopt_sample_vertices(state, boundaries);
    write_tile(lattice.type, context, state, mesh.positions.data() + state.vertex_base,
               options.normals ? mesh.normals.data() + state.vertex_base : nullptr,
               mesh.triangles.data() + state.triangle_base);
  }

  void resize_for(const TileState& last) {
    mesh.positions.resize(last.vertex_base + last.vertices);
    if (options.normals) mesh.normals.resize(last.vertex_base + last.vertices);
    mesh.triangles.resize(last.triangle_base + last.triangles);
  }

  void count_batch(std::span<const TileWork> tiles, const TileSamples& samples) {
    const std::size_t n = tiles.size();
    while (states.size() < n) states.push_back(std::make_unique<TileState>());
    for (std::size_t i = 0; i < n; ++i)
      states[i]->boundary = welded() ? boundaries.add(tiles[i].tile) : nullptr;
    for_each_tile(0, n, [&](std::size_t i) { count(*states[i], tiles[i], samples); });
  }

  /// Numbers the vertices of tiles before the part.
  void number_batch(std::span<const TileWork> tiles, const TileSamples& samples) {
    count_batch(tiles, samples);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      TileState& state = *states[i];
      state.number_base = static_cast<std::uint32_t>(made.vertices);
      state.boundary->base = state.number_base;
      made.vertices += state.vertices;
      before.vertices += state.vertices;
      note_place(state);
    }
    check_numbers();
    boundaries.forget_before(tiles.back().tile);
  }

  void extract_batch(std::span<const TileWork> tiles, const TileSamples& samples) {
    const std::size_t n = tiles.size();
    count_batch(tiles, samples);
    for (std::size_t begin = 0; begin < n;) {
      const std::size_t end = place(begin, n);
      if (end > begin) {
        resize_for(*states[end - 1]);
        for_each_tile(begin, end, [&](std::size_t i) { write(*states[i]); });
      }
      begin = end;
      if (begin < n) hand_on();
    }
    if (welded()) boundaries.forget_before(tiles.back().tile);
  }

  void hand_on() {
    if (mesh.positions.size() + mesh.triangles.size() > 0)
      writer->write(mesh, made.vertices - mesh.positions.size());
  }

  /// Calls f(batch) for `tiles` in batches of one size: a small last one would keep few threads
  /// busy.
  template <class F>
  void for_each_batch(std::span<const TileWork> tiles, const F& f) const {
    while (!tiles.empty()) {
      const std::size_t parts = (tiles.size() + limits.tiles - 1) / limits.tiles;
      const std::size_t batch = (tiles.size() + parts - 1) / parts;
      f(tiles.first(batch));
      tiles = tiles.subspan(batch);
    }
  }

  void extract(std::span<const TileWork> tiles, const TileSamples& samples) {
    const auto own = std::find_if(tiles.begin(), tiles.end(), [&](const TileWork& work) {
      return !places || part.contains(work.tile);
    });
    const auto others = static_cast<std::size_t>(own - tiles.begin());
    for_each_batch(tiles.first(others), [&](auto batch) { number_batch(batch, samples); });
    for_each_batch(tiles.subspan(others), [&](auto batch) { extract_batch(batch, samples); });
    if (writer) hand_on();
  }
};

CpuExtractor::CpuExtractor(const Lattice& lattice, const SurfaceOptions& options,
                           ExtractorLimits limits, MeshSink* sink,
                           std::shared_ptr<TileWorkSpaces> spaces)
    : impl_(std::make_unique<Impl>(lattice, options, limits, sink, std::move(spaces))) {}
CpuExtractor::~CpuExtractor() = default;

void CpuExtractor::extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
                           const std::shared_ptr<const void>&) {
  extract(tiles, BrickSamples(impl_->lattice, bricks, impl_->options.fill_value));
}

void CpuExtractor::extract(std::span<const TileWork> tiles, const TileSamples& samples) {
  const Stopwatch watch(impl_->made.surface.seconds);
  impl_->extract(tiles, samples);
}

void CpuExtractor::make_part(const TileRange& part, TilePlaces& places) {
  impl_->part = part;
  impl_->places = &places;
}

void CpuExtractor::finish() {
  if (impl_->writer) impl_->writer->finish();
}

SurfaceReport CpuExtractor::report() const {
  SurfaceReport report = impl_->made;
  report.vertices -= impl_->before.vertices;
  if (impl_->writer) report.sink = impl_->writer->report();
  report.surface.bytes = report.sink.bytes;
  return report;
}

Mesh& CpuExtractor::mesh() { return impl_->mesh; }

MeshSize CpuExtractor::count(const TileWork& tile, const BrickLookup& bricks) const {
  return count(tile, bricks, impl_->options.roi);
}

MeshSize CpuExtractor::count(const TileWork& tile, const BrickLookup& bricks, Box3 region) const {
  const auto state = std::make_unique<TileState>();
  KernelContext context = impl_->context;
  context.border = region;
  impl_->count(*state, tile, BrickSamples(impl_->lattice, bricks, impl_->options.fill_value),
               context);
  return {state->vertices, state->triangles};
}

void CpuExtractor::restart() {
  impl_->boundaries.clear();
  impl_->mesh.clear();
  impl_->made = {};
  impl_->before = {};
}

std::size_t CpuExtractor::preferred_batch(int threads) {
  return kTilesPerThread * static_cast<std::size_t>(threads);
}

MeshSize CpuExtractor::max_in_cell(Topology topology) {
  if (topology == Topology::trilinear) return {kMaxPatchInner, kMaxPatchTriangles};
  return {0, kMaxCaseTriangles};
}

// As if every edge of a tile had a vertex and every cell a triangle: any input fits. With the
// boundary, which waits at least until the batch is over.
std::uint64_t CpuExtractor::workspace_bytes(ScalarType type, bool drop_degenerate,
                                            Topology topology, const CapBounds& cap) {
  const std::uint64_t coincident =
      drop_degenerate ? sizeof(CoincidentVertices) + kTileVolume * sizeof(ActiveCell) : 0;
  // Lists of caps and of vertices on samples grow by halves.
  const std::uint64_t faces =
      cap.faces == 0 ? 0 : sizeof(TileCap) + cap.faces * sizeof(CapFace) * 3 / 2;
  const std::uint64_t samples =
      drop_degenerate ? std::uint64_t{kTileRows} * kTileSamples : cap.vertices;
  const std::uint64_t on_samples =
      samples == 0 ? 0 : sizeof(SampleVertices) + samples * sizeof(SampleVertex) * 3 / 2;
  return sizeof(TileState) + boundary_bytes_of_tile(drop_degenerate, cap) + coincident + faces +
         on_samples + TileLayout::kSize * size_of(type) + kTileVolume * sizeof(ActiveCell) +
         (topology == Topology::trilinear ? kTileVolume * sizeof(PatchedCell) : 0) +
         kMaxEdges * sizeof(std::uint32_t);
}

std::uint64_t CpuExtractor::boundary_bytes(Int3 tiles, bool drop_degenerate, const CapBounds& cap) {
  return BoundaryMap::max_size(tiles) * boundary_bytes_of_tile(drop_degenerate, cap);
}

std::uint64_t CpuExtractor::max_tile_output(bool normals, Topology topology, const CapBounds& cap) {
  const MeshSize of_cell = max_in_cell(topology);
  return mesh_bytes({.vertices = kMaxEdges + of_cell.vertices * kTileVolume + cap.vertices,
                     .triangles = of_cell.triangles * kTileVolume + cap.faces * kMaxFaceTriangles},
                    normals);
}

}  // namespace isobrick

#include <isobrick/estimate.h>

#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/box_union.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/extract/tile_sample.h"
#include "pipeline/workers.h"
#include "stream/brick_cache.h"
#include "stream/distinct_bricks.h"
#include "stream/tile_stream.h"
#include "surface/case_rule.h"

namespace isobrick::inline v0 {
namespace {

/// Groups of tiles that are looked at: enough for 10 % where groups differ by
/// half of their mean.
constexpr std::size_t kMaxGroups = 64;
/// Fewer where samples or bricks are big, so that decoding stays at some 10 ms a core.
constexpr std::uint64_t kMaxBytes = std::uint64_t{32} << 20;
constexpr std::size_t kMinGroups = 4;

/// Adds the cells between `samples` in the active blocks of a tile.
void add_cells(const TileWork& work, Box3 samples, ActiveParts& parts) {
  for_each_active_block(work, samples, [&](Box3 cells) {
    parts.active_cells += static_cast<std::uint64_t>(volume(cells.extent()));
    parts.bounds = unite(parts.bounds, cells);
  });
}

/// Adds a tile's active cells and blocks; calls brick(number) for the brick of each.
template <class F>
void count_tile(const ExtractRequest& request, const TileWork& work, ActiveParts& parts,
                F&& brick) {
  const Lattice& lattice = request.level->lattice;
  add_cells(work, request.surface.roi, parts);
  for (int i = 0; i < 8; ++i) {
    if (!(work.active_blocks >> i & 1)) continue;
    ++parts.active_blocks;
    const Int3 of_block = lattice.brick_of(cells_of_block(work.tile, i).lo);
    brick(static_cast<std::size_t>(linear_index(of_block, lattice.bricks())));
  }
}

/// What is active at each of several isovalues.
class ActiveCounts {
 public:
  ActiveCounts(const ExtractRequest& request, std::size_t isovalues)
      : parts_(isovalues), bricks_(isovalues, DistinctBricks(request.level->lattice)) {}

  std::size_t isovalues() const { return parts_.size(); }
  ActiveParts& parts(std::size_t i) { return parts_[i]; }
  DistinctBricks& bricks(std::size_t i) { return bricks_[i]; }
  std::vector<ActiveParts> counted() {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      parts_[i].bricks = bricks_[i].all();
      parts_[i].active_bricks = bricks_[i].count();
    }
    return std::move(parts_);
  }

 private:
  std::vector<ActiveParts> parts_;
  std::vector<DistinctBricks> bricks_;
};

/// Counts what is active and calls visit(TileWork) for every tile that is active at any of the
/// isovalues, in order.
template <class F>
std::vector<ActiveParts> visit_active(const StoreReader& store, const ExtractRequest& request,
                                      int level, std::span<const double> isovalues, F&& visit) {
  ActiveCounts counts(request, isovalues.size());
  TileStream tiles(store, level, {isovalues.begin(), isovalues.end()}, request.surface.roi,
                   request.search, cap_search(request.surface));
  Workers workers(request.threads);  // an index is searched in parallel
  while (const auto work = workers.execute([&] { return tiles.next(); })) {
    visit(*work);
    for (std::size_t i = 0; i < isovalues.size(); ++i)
      count_tile(request, {work->tile, tiles.blocks_of_each()[i]}, counts.parts(i),
                 [&](std::size_t brick) { counts.bricks(i).add(brick); });
  }
  return counts.counted();
}

/// The region's parts of the range chunks, each with the samples where its last cells end.
std::vector<Box3> range_chunks(const ExtractRequest& request) {
  constexpr Index edge = StoreReader::kRangeChunk * kBlockEdge;
  constexpr Int3 one{1, 1, 1};
  std::vector<Box3> chunks;
  for_each_point({{0, 0, 0}, ceil_div(request.level->lattice.extent, one * edge)}, [&](Int3 c) {
    const Box3 part = intersect({c * edge, (c + one) * edge + one}, request.surface.roi);
    if (!part.empty()) chunks.push_back(part);
  });
  return chunks;
}

/// What is active in one range chunk.
struct ChunkCount {
  ActiveParts parts;
  std::vector<std::size_t> bricks;  ///< any of them more than once
};

std::vector<ChunkCount> count_in_chunk(const StoreReader& store, const ExtractRequest& request,
                                       int level, std::span<const double> isovalues,
                                       const Box3& chunk) {
  std::vector<ChunkCount> counts(isovalues.size());
  TileStream tiles(store, level, {isovalues.begin(), isovalues.end()}, chunk, {},
                   cap_search(request.surface));
  while (const auto work = tiles.next())
    for (std::size_t i = 0; i < counts.size(); ++i) {
      std::vector<std::size_t>& bricks = counts[i].bricks;
      count_tile(request, {work->tile, tiles.blocks_of_each()[i]}, counts[i].parts,
                 [&](std::size_t brick) {
                   if (bricks.empty() || bricks.back() != brick) bricks.push_back(brick);
                 });
    }
  return counts;
}

/// Counts what is active by the ranges alone, several range chunks at a time.
std::vector<ActiveParts> count_in_ranges(const StoreReader& store, const ExtractRequest& request,
                                         int level, std::span<const double> isovalues) {
  ActiveCounts counts(request, isovalues.size());
  std::mutex adding;
  Workers workers(request.threads);
  workers.execute([&] {
    tbb::parallel_for_each(range_chunks(request), [&](const Box3& chunk) {
      const auto of_chunk = count_in_chunk(store, request, level, isovalues, chunk);
      const std::lock_guard lock(adding);
      for (std::size_t i = 0; i < of_chunk.size(); ++i) {
        const ActiveParts& own = of_chunk[i].parts;
        ActiveParts& parts = counts.parts(i);
        parts.active_blocks += own.active_blocks;
        parts.active_cells += own.active_cells;
        parts.bounds = unite(parts.bounds, own.bounds);
        for (const std::size_t brick : of_chunk[i].bricks) counts.bricks(i).add(brick);
      }
    });
  });
  return counts.counted();
}

/// The bricks in which a tile's 32³ samples lie. Its last layer of cells may
/// need one sample more from the bricks behind; rather than to read those for
/// it, it is left out then.
Box3 own_bricks(const Lattice& lattice, Int3 tile) {
  const Int3 lo = tile * kTileEdge;
  return lattice.bricks_of(
      intersect({lo, lo + Int3{kTileEdge, kTileEdge, kTileEdge}}, lattice.box()));
}

/// Only some of a cache's bricks; the rest is as good as absent.
class SomeBricks final : public BrickLookup {
 public:
  SomeBricks(const BrickLookup& all, Box3 box) : all_(all), box_(box) {}
  const std::byte* find(Int3 b) const override { return box_.contains(b) ? all_.find(b) : nullptr; }

 private:
  const BrickLookup& all_;
  Box3 box_;
};

/// The cells of active blocks that were looked at, and what of the surface
/// lies in them.
struct Sampled {
  double cells = 0, triangles = 0, vertices = 0;
  Sampled& operator+=(const Sampled& other) {
    cells += other.cells;
    triangles += other.triangles;
    vertices += other.vertices;
    return *this;
  }
};

Sampled look_at(const TileWork& work, const ExtractRequest& request, const BrickLookup& bricks) {
  const Lattice& lattice = request.level->lattice;
  const Box3 own = own_bricks(lattice, work.tile);
  const Int3 corner = work.tile * kTileEdge;
  const Box3 samples = intersect({corner, own.hi * lattice.brick}, request.surface.roi);
  ActiveParts parts;
  add_cells(work, samples, parts);
  const std::uint64_t cells = parts.active_cells;
  if (cells == 0) return {};
  SurfaceOptions surface = request.surface;
  surface.normals = false;
  // Begun one tile earlier where there is one, so that the vertices on the
  // tile's lower planes are not its own: they are counted with that tile.
  surface.roi.lo = max(min(samples.lo, corner - Int3{1, 1, 1}), request.surface.roi.lo);
  surface.roi.hi = samples.hi;
  const CpuExtractor extractor(lattice, surface, {.tiles = 1});
  const MeshSize size = extractor.count(work, SomeBricks(bricks, own), request.surface.roi);
  return {static_cast<double>(cells), static_cast<double>(size.triangles),
          static_cast<double>(size.vertices)};
}

std::vector<Sampled> look_at_all(const StoreReader& store, const ExtractOptions& options,
                                 const ExtractRequest& request, std::span<const TileWork> tiles,
                                 std::size_t cache_bricks) {
  const Lattice& lattice = request.level->lattice;
  BrickCache cache(store, options.level, sample_reach(request.surface), cache_bricks);
  std::vector<Sampled> sampled(tiles.size());
  std::vector<Int3> bricks;
  for (std::size_t begin = 0, end = 0; begin < tiles.size(); begin = end) {
    bricks.clear();
    for (; end < tiles.size(); ++end) {
      std::vector<Int3> more;
      for_each_point(own_bricks(lattice, tiles[end].tile), [&](Int3 b) {
        if (std::find(bricks.begin(), bricks.end(), b) == bricks.end()) more.push_back(b);
      });
      if (end > begin && bricks.size() + more.size() > cache_bricks) break;
      bricks.insert(bricks.end(), more.begin(), more.end());
    }
    const auto cached = cache.begin(bricks, tiles[end - 1].tile);
    cached->wait();
    tbb::parallel_for(begin, end,
                      [&](std::size_t i) { sampled[i] = look_at(tiles[i], request, *cached); });
  }
  return sampled;
}

/// How many groups of tiles to sample; even.
std::size_t groups_to_sample(const Lattice& lattice) {
  std::uint64_t bytes = lattice.sample_bytes();  // of the bricks that a group lies in
  for (int axis = 0; axis < 3; ++axis) {
    constexpr Index edge = 2 * kTileEdge;
    const Index brick = lattice.brick[axis];
    const Index latest = brick - std::gcd(brick, edge);  // where in its first brick one begins
    bytes *= static_cast<std::uint64_t>(((latest + edge - 1) / brick + 1) * brick);
  }
  return std::clamp<std::size_t>(kMaxBytes / bytes & ~std::uint64_t{1}, kMinGroups, kMaxGroups);
}

/// Scales what was seen in some groups to all active cells, and computes
/// the standard error of that ratio of sums.
void scale(std::span<const Sampled> sampled, std::uint64_t cells, ExtractEstimate& result) {
  Sampled sum;
  for (const Sampled& s : sampled) sum += s;
  if (sum.triangles == 0) return;
  const double factor = static_cast<double>(cells) / sum.cells;
  result.mesh.triangles = static_cast<std::uint64_t>(std::llround(sum.triangles * factor));
  result.mesh.vertices = static_cast<std::uint64_t>(std::llround(sum.vertices * factor));
  const auto n = static_cast<double>(sampled.size());
  double squares = 0;
  for (const Sampled& s : sampled) {
    const double off = s.triangles - s.cells * sum.triangles / sum.cells;
    squares += off * off;
  }
  const double unseen = 1 - sum.cells / static_cast<double>(cells);
  result.uncertainty = 2 * std::sqrt(squares * n / std::max(1.0, n - 1) * unseen) / sum.triangles;
}

}  // namespace

ActiveParts count_active(const StoreReader& store, const ExtractOptions& options) {
  return count_active(store, options, std::span(&options.isovalue, 1)).front();
}

std::vector<ActiveParts> count_active(const StoreReader& store, const ExtractOptions& options,
                                      std::span<const double> isovalues) {
  const ExtractRequest request = check_request(store, options, Indexing::welded);
  if (!request.search.kind) return count_in_ranges(store, request, options.level, isovalues);
  return visit_active(store, request, options.level, isovalues, [](const TileWork&) {});
}

MeshSize largest_mesh(const ActiveParts& active, Topology topology, bool cap) {
  constexpr std::uint64_t closed = kBlockEdge + 1;
  constexpr std::uint64_t samples = closed * closed * closed;
  constexpr std::uint64_t faces = 3 * closed * kBlockEdge * kBlockEdge;
  const MeshSize of_cell = CpuExtractor::max_in_cell(topology);
  return {(cap ? 4 : 3) * samples * active.active_blocks + of_cell.vertices * active.active_cells,
          of_cell.triangles * active.active_cells +
              (cap ? kMaxFaceTriangles * faces * active.active_blocks : 0)};
}

ExtractEstimate estimate(const StoreReader& store, const ExtractOptions& options,
                         std::uint64_t sink_bytes) {
  ExtractRequest request = check_request(store, options, Indexing::welded);
  TileSample sample(groups_to_sample(request.level->lattice));
  const ActiveParts parts =
      visit_active(store, request, options.level, std::span(&options.isovalue, 1),
                   [&](const TileWork& work) { sample.add(work); })
          .front();
  request.active_bricks = parts.active_bricks;
  request.sink_bytes = sink_bytes;
  const ExtractPlan plan =
      plan_memory({&request, 1}, options.memory,
                  decode_extra(store.info(), request.threads) + store.storage()->memory());
  ExtractEstimate result{.active = parts, .memory = plan.bytes};
  const std::vector<TileGroup> groups = sample.chosen();
  std::vector<TileWork> tiles;
  for (const TileGroup& group : groups)
    tiles.insert(tiles.end(), group.tiles, group.tiles + group.count);
  Workers workers(request.threads);
  const std::vector<Sampled> of_tiles = workers.execute(
      [&] { return look_at_all(store, options, request, tiles, plan.cache_bricks); });
  std::vector<Sampled> of_groups(groups.size());
  auto next = of_tiles.begin();
  for (std::size_t i = 0; i < groups.size(); ++i)
    for (int k = 0; k < groups[i].count; ++k) of_groups[i] += *next++;
  scale(of_groups, parts.active_cells, result);
  return result;
}

}  // namespace isobrick

#include "isobrick/pipeline/extract.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

#include "isobrick/pipeline/chunk_writer.h"
#include "isobrick/pipeline/estimate.h"
#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/pipeline/workers.h"
#include "isobrick/stream/brick_cache.h"
#include "isobrick/stream/tile_stream.h"

namespace isobrick {
namespace {

/// Adds the time it lives to a sum of seconds.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum) : sum_(sum) {}
  ~Stopwatch() {
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start_;
    sum_ += took.count();
  }

 private:
  double& sum_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// World-space corners of a level's sample box.
MeshHeader header_of(const LevelInfo& level, const SurfaceOptions& surface) {
  MeshHeader header;
  header.has_normals = surface.normals;
  for (int corner = 0; corner < 8; ++corner) {
    const Int3 last = level.lattice.extent - Int3{1, 1, 1};
    const Vec3d p = level.transform.apply({corner & 1 ? static_cast<double>(last.x) : 0.0,
                                           corner & 2 ? static_cast<double>(last.y) : 0.0,
                                           corner & 4 ? static_cast<double>(last.z) : 0.0});
    for (int axis = 0; axis < 3; ++axis) {
      header.world_lo[axis] = corner ? std::fmin(header.world_lo[axis], p[axis]) : p[axis];
      header.world_hi[axis] = corner ? std::fmax(header.world_hi[axis], p[axis]) : p[axis];
    }
  }
  return header;
}

}  // namespace

ExtractReport extract(const StoreReader& store, const ExtractOptions& options, MeshSink& sink,
                      Progress& progress) {
  ExtractReport report;
  const std::uint64_t bytes_before = store.bytes_read();
  {
    Stopwatch whole(report.seconds);
    const ExtractRequest request = check_request(store, options, sink.indexing());
    const Lattice& lattice = request.level->lattice;
    const Index reach = sample_reach(request.surface);

    ActiveParts active;
    {
      Stopwatch watch(report.plan_seconds);
      active = count_active(store, options);
    }
    report.bricks = active.bricks;
    report.active_bricks = active.active_bricks;
    const ExtractPlan plan =
        plan_memory(request, options.memory, active.active_bricks,
                    sink.memory() + decode_extra(store.info(), request.threads));

    sink.begin(header_of(*request.level, request.surface));
    TileStream tiles(store, options.level, options.isovalue, request.surface.roi, request.search);
    BatchPlanner batches(tiles, lattice, reach, request.surface.may_have_nan, plan.limits.tiles,
                         plan.cache_bricks);
    BrickCache cache(store, options.level, plan.cache_bricks);
    CpuExtractor extractor(lattice, request.surface, plan.limits);
    ChunkWriter writer(sink);
    MeshBuffer mesh;
    TileBatch batch, following;
    progress.begin("extracting", active.active_bricks * lattice.brick_bytes());
    const double bytes_per_block = static_cast<double>(active.active_bricks) *
                                   static_cast<double>(lattice.brick_bytes()) /
                                   std::max(1.0, static_cast<double>(active.active_blocks));
    Workers workers(request.threads);
    workers.execute([&] {
      for (bool more = batches.next(batch); more; std::swap(batch, following)) {
        {
          Stopwatch watch(report.decode_seconds);
          cache.require(batch.bricks);
        }
        // The disk works on the next batch while the processors work on this one.
        more = batches.next(following);
        cache.will_need(following.bricks);
        {
          Stopwatch watch(report.surface_seconds);
          extractor.extract(batch.tiles, cache, mesh,
                            [&](MeshBuffer& m, std::uint64_t first) { writer.write(m, first); });
        }
        double blocks = 0;
        for (const TileWork& work : batch.tiles)
          blocks += static_cast<double>(std::popcount(work.active_blocks));
        progress.advance(static_cast<std::uint64_t>(blocks * bytes_per_block));
      }
    });
    writer.finish();
    sink.finish();
    progress.end();
    report.sink_seconds = writer.seconds();
    report.index = request.search.kind;
    report.search_bytes = tiles.range_bytes() + tiles.index_bytes();
    // Once for the plan and once for the surface; the index has files of its own.
    report.bytes_read = 2 * tiles.index_bytes();
    report.search_seconds = tiles.seconds();
    report.triangles = extractor.triangles();
    report.vertices = extractor.vertices();
    report.degenerate_triangles = extractor.degenerate_triangles();
    report.bricks_read = cache.bricks_read();
    report.brick_reads = cache.reads();
  }
  report.bytes_read += store.bytes_read() - bytes_before;
  return report;
}

}  // namespace isobrick

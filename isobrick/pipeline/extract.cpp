#include "isobrick/pipeline/extract.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <future>
#include <utility>
#include <vector>

#include "isobrick/core/morton.h"
#include "isobrick/pipeline/backend_choice.h"
#include "isobrick/pipeline/estimate.h"
#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/pipeline/workers.h"
#include "isobrick/stream/batch_decoder.h"
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

/// Called with the tiles that are done.
using Done = std::function<void(std::span<const TileWork>)>;

/// An extraction that is under way.
struct Work {
  const StoreReader& store;
  const ExtractOptions& options;
  const ExtractRequest& request;
  const ExtractPlan& plan;
  BatchPlanner& batches;
  ExtractReport& report;
  Done done;
};

/// Batch after batch, each decoded and then extracted, for the surface keeps all cores
/// busy itself.
void extract_on_cpu(const Work& work, SurfaceExtractor& surface) {
  BrickCache cache(work.store, work.options.level, sample_reach(work.request.surface),
                   work.plan.cache_bricks);
  Workers workers(work.request.threads);
  workers.execute([&] {
    TileBatch batch, following;
    for (bool more = work.batches.next(batch); more; std::swap(batch, following)) {
      {
        Stopwatch watch(work.report.decode_seconds);
        cache.drop_before(morton_encode(batch.tiles.front().tile));
        cache.require(batch.bricks);
      }
      // The disk works on the next batch while the processors work on this one.
      more = work.batches.next(following);
      cache.will_need(following.bricks);
      {
        Stopwatch watch(work.report.surface_seconds);
        surface.extract(batch.tiles, cache, nullptr);
      }
      work.done(batch.tiles);
    }
  });
  surface.finish();
  surface.report(work.report);
  work.report.bricks_read = cache.bricks_read();
  work.report.brick_reads = cache.reads();
}

/// All cores decode, ahead of the GPU; this thread sends batches off as they are decoded.
void extract_on_gpu(const Work& work, GpuSession& gpu, std::unique_ptr<SurfaceExtractor> made) {
  BatchDecoder decoder(work.store, work.options.level, work.batches,
                       sample_reach(work.request.surface), work.plan.cache_bricks,
                       work.request.threads, gpu.bricks());
  const auto surface = std::move(made);  // ends first: it holds batches
  for (;;) {
    std::shared_ptr<const DecodedBatch> batch;
    {
      Stopwatch watch(work.report.decode_seconds);
      batch = decoder.next();
    }
    if (!batch) break;
    {
      Stopwatch watch(work.report.surface_seconds);
      surface->extract(batch->tiles(), *batch, batch);
    }
    work.done(batch->tiles());
  }
  surface->finish();
  surface->report(work.report);
  if (gpu.pool_bricks() == 0) work.report.pinned_bytes += decoder.memory_bytes();
  work.report.bricks_read = decoder.bricks_read();
  work.report.brick_reads = decoder.reads();
}

/// Counts what is active and sets up who makes the surface. A device takes some tenths of a
/// second to open: when it is known that there will be one, that goes on meanwhile.
ChosenBackend choose_backend(const ExtractRequest& request, const ExtractOptions& options,
                             const StoreReader& store, MeshSink& sink, ActiveParts& active) {
  std::future<std::unique_ptr<GpuSession>> early;
  if (options.backend == Backend::cuda && use_cuda(request, options, 0))
    early = std::async(std::launch::async, open_gpu, options.device);
  active = count_active(store, options);
  const bool wanted = early.valid() || use_cuda(request, options, active.active_blocks);
  const std::uint64_t other = sink.memory() + decode_extra(store.info(), request.threads);
  return set_up_backend(request, options, active.active_bricks, other, sink,
                        [&]() -> std::unique_ptr<GpuSession> {
                          if (early.valid()) return early.get();
                          return wanted ? open_gpu(options.device) : nullptr;
                        });
}

}  // namespace

std::vector<std::pair<std::string_view, StageReport>> stages_of(const ExtractReport& r) {
  if (r.backend == "cpu")
    return {{"read", r.read}, {"decode", r.decode}, {"surface", r.surface}, {"sink", r.sink}};
  return {{"read", r.read},     {"decode", r.decode}, {"upload", r.upload},
          {"gather", r.gather}, {"kernel", r.kernel}, {"download", r.download},
          {"sink", r.sink}};
}

std::string_view bound_of(const ExtractReport& report) {
  const auto stages = stages_of(report);
  return std::max_element(
             stages.begin(), stages.end(),
             [](const auto& a, const auto& b) { return a.second.seconds < b.second.seconds; })
      ->first;
}

ExtractReport extract(const StoreReader& store, const ExtractOptions& options, MeshSink& sink,
                      Progress& progress) {
  ExtractReport report;
  const std::uint64_t bytes_before = store.bytes_read();
  const BrickTimes times_before = store.brick_times();
  {
    Stopwatch whole(report.seconds);
    const ExtractRequest request = check_request(store, options, sink.indexing());
    const Lattice& lattice = request.level->lattice;
    const Index reach = sample_reach(request.surface);

    ActiveParts active;
    ChosenBackend backend;
    {
      Stopwatch watch(report.plan_seconds);
      backend = choose_backend(request, options, store, sink, active);
    }
    const ExtractPlan& plan = backend.plan;
    report.bricks = active.bricks;
    report.active_bricks = active.active_bricks;
    report.gpu_refusal = backend.gpu_refusal;

    sink.begin(header_of(*request.level, request.surface));
    TileStream tiles(store, options.level, options.isovalue, request.surface.roi, request.search);
    BatchPlanner batches(tiles, lattice, reach, request.surface.may_have_nan, plan.limits.tiles,
                         plan.batch_bricks);
    progress.begin("extracting", active.active_bricks * lattice.brick_bytes());
    const double bytes_per_block = static_cast<double>(active.active_bricks) *
                                   static_cast<double>(lattice.brick_bytes()) /
                                   std::max(1.0, static_cast<double>(active.active_blocks));
    const auto done = [&](std::span<const TileWork> of_batch) {
      double blocks = 0;
      for (const TileWork& tile : of_batch)
        blocks += static_cast<double>(std::popcount(tile.active_blocks));
      progress.advance(static_cast<std::uint64_t>(blocks * bytes_per_block));
    };
    const Work work{store, options, request, plan, batches, report, done};
    if (backend.gpu)
      extract_on_gpu(work, *backend.gpu, std::move(backend.surface));
    else
      extract_on_cpu(work, *backend.surface);
    sink.finish();
    progress.end();
    report.index = request.search.kind;
    report.search_bytes = tiles.range_bytes() + tiles.index_bytes();
    // Once for the plan and once for the surface; the index has files of its own.
    report.bytes_read = 2 * tiles.index_bytes();
    report.search_seconds = tiles.seconds();
    const BrickTimes times = store.brick_times();
    report.read = {(times.read_seconds - times_before.read_seconds) / request.threads,
                   times.bytes_read - times_before.bytes_read};
    report.decode = {(times.decode_seconds - times_before.decode_seconds) / request.threads,
                     times.bytes_decoded - times_before.bytes_decoded};
  }
  report.bytes_read += store.bytes_read() - bytes_before;
  return report;
}

}  // namespace isobrick

#include "isobrick/pipeline/extract.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <future>
#include <utility>
#include <vector>

#include "isobrick/core/length_unit.h"
#include "isobrick/core/morton.h"
#include "isobrick/pipeline/backend_choice.h"
#include "isobrick/pipeline/estimate.h"
#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/pipeline/extract_tiles.h"
#include "isobrick/pipeline/workers.h"
#include "isobrick/stream/brick_cache.h"

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

/// World-space bounds of the samples from `first` to `last`.
MeshBounds world_bounds(const Transform& transform, Int3 first, Int3 last) {
  MeshBounds bounds;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p = transform.apply({static_cast<double>(corner & 1 ? last.x : first.x),
                                     static_cast<double>(corner & 2 ? last.y : first.y),
                                     static_cast<double>(corner & 4 ? last.z : first.z)});
    for (int axis = 0; axis < 3; ++axis) {
      bounds.lo[axis] = corner ? std::fmin(bounds.lo[axis], p[axis]) : p[axis];
      bounds.hi[axis] = corner ? std::fmax(bounds.hi[axis], p[axis]) : p[axis];
    }
  }
  return bounds;
}

MeshHeader header_of(const LevelInfo& level, const SurfaceOptions& surface,
                     const ActiveParts& active) {
  const MeshBounds all =
      world_bounds(level.transform, {0, 0, 0}, level.lattice.extent - Int3{1, 1, 1});
  MeshHeader header{surface.normals, all.lo, all.hi};
  header.unit = unit_name(level.transform.unit);
  // The last cells end at the samples behind them.
  if (!active.bounds.empty())
    header.surface = world_bounds(level.transform, active.bounds.lo, active.bounds.hi);
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
  ExtractReport& report;
  Done done;
};

/// Tiles whose bricks are there or on their way; none at the end.
struct CpuBatch {
  TileBatch batch;
  std::unique_ptr<CachedBricks> bricks;
};

/// Hands the batches of an extraction out, and their bricks.
class CpuBatches {
 public:
  CpuBatches(const Work& work, BatchPlanner& planner)
      : planner_(planner),
        cache_(work.store, work.options.level, sample_reach(work.request.surface),
               work.plan.cache_bricks) {
    planner_.next(planned_);
  }

  CpuBatch next() {
    CpuBatch next{.batch = std::exchange(planned_, {})};
    if (!next.batch.tiles.empty()) planner_.next(planned_);
    return next;
  }

  /// Begins to decode a batch's bricks; the disk works on those of the batch after it.
  void begin(CpuBatch& batch) {
    if (batch.batch.tiles.empty()) return;
    batch.bricks = cache_.begin(batch.batch.bricks, batch.batch.tiles.back().tile);
    cache_.will_need(*batch.bricks, planned_.bricks);
  }

  const BrickCache& cache() const { return cache_; }

 private:
  BatchPlanner& planner_;
  BrickCache cache_;
  TileBatch planned_;
};

void report_search(const TileStream& tiles, ExtractReport& report) {
  report.search_bytes = tiles.range_bytes() + tiles.index_bytes();
  // Once for the plan and once for the surface; the index has files of its own.
  report.bytes_read = 2 * tiles.index_bytes();
  report.search_seconds = tiles.seconds();
}

/// Threads' time of reading and decoding so far.
double bricks_seconds(const StoreReader& store) {
  const BrickTimes times = store.brick_times();
  return times.read_seconds + times.decode_seconds;
}

/// While the surface of one batch is made the bricks of the next are decoded, by the same
/// threads: where the one has nothing to do for them just then, the other has.
void extract_on_cpu(const Work& work, SurfaceExtractor& surface) {
  PlannedTiles planned(tiles_of(work.store, work.options, work.request), work.request, work.plan);
  double decoded_beside = 0;  // of threads
  const bool room_for_two = work.plan.cache_bricks >= 2 * work.plan.batch_bricks;
  Workers workers(work.request.threads);
  workers.execute([&] {
    CpuBatches batches(work, planned.batches);
    CpuBatch now = batches.next();
    batches.begin(now);
    while (now.bricks) {
      CpuBatch next = batches.next();
      if (room_for_two) batches.begin(next);
      {
        Stopwatch watch(work.report.decode_seconds);
        now.bricks->wait();
      }
      const double decoded_before = bricks_seconds(work.store);
      {
        Stopwatch watch(work.report.surface_seconds);
        surface.extract(now.batch.tiles, *now.bricks, nullptr);
      }
      decoded_beside += bricks_seconds(work.store) - decoded_before;
      work.done(now.batch.tiles);
      now.bricks.reset();
      if (!room_for_two) batches.begin(next);
      now = std::move(next);
    }
    work.report.bricks_read = batches.cache().bricks_read();
    work.report.brick_reads = batches.cache().reads();
  });
  surface.finish();
  surface.report(work.report);
  double& seconds = work.report.surface.seconds;
  seconds = std::max(0.0, seconds - decoded_beside / work.request.threads);
  report_search(planned.tiles, work.report);
}

/// All cores decode, ahead of the GPU; this thread sends batches off as they are decoded.
void extract_on_gpu(const Work& work, ChosenBackend& backend) {
  BatchDecoder& decoder = backend.decoded->decoder;
  SurfaceExtractor* const surface = backend.surface.get();
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
  if (backend.gpu->pool_bricks() == 0) work.report.pinned_bytes += decoder.memory_bytes();
  work.report.bricks_read = decoder.bricks_read();
  work.report.brick_reads = decoder.reads();
  report_search(backend.decoded->planned.tiles, work.report);
  // Their memory is freed before the sink ends its file.
  backend.surface.reset();
  backend.decoded.reset();
}

/// Counts what is active and sets up who makes the surface. A device takes some tenths of a
/// second to open: when it is known that there will be one, that goes on meanwhile, and the first
/// tiles are found.
ChosenBackend choose_backend(const ExtractRequest& request, const ExtractOptions& options,
                             const StoreReader& store, MeshSink& sink, ActiveParts& active) {
  std::future<std::unique_ptr<GpuSession>> early;
  std::future<TileStream> first;
  if (options.backend == Backend::cuda && use_cuda(request, options, 0)) {
    early = std::async(std::launch::async, open_gpu, options.device);
    first = std::async(std::launch::async, [&] {
      TileStream tiles = tiles_of(store, options, request);
      Workers(request.threads).execute([&] { tiles.begin(); });
      return tiles;
    });
  }
  active = count_active(store, options);
  const bool wanted = early.valid() || use_cuda(request, options, active.active_blocks);
  const std::uint64_t other = sink.memory() + decode_extra(store.info(), request.threads);
  return set_up_backend(
      request, options, active.active_bricks, other, sink,
      [&]() -> std::unique_ptr<GpuSession> {
        if (early.valid()) return early.get();
        return wanted ? open_gpu(options.device) : nullptr;
      },
      [&](const ExtractPlan& plan, GpuSession& gpu) {
        return std::make_unique<DecodedTiles>(
            store, options.level, first.valid() ? first.get() : tiles_of(store, options, request),
            request, plan, gpu.bricks());
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

std::uint64_t least_extract_memory(const StoreReader& store, const ExtractOptions& options,
                                   Indexing indexing, std::uint64_t sink_bytes) {
  const ExtractRequest request = check_request(store, options, indexing);
  return least_memory(request, sink_bytes + decode_extra(store.info(), request.threads));
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

    sink.begin(header_of(*request.level, request.surface, active));
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
    const Work work{store, options, request, plan, report, done};
    if (backend.gpu)
      extract_on_gpu(work, backend);
    else
      extract_on_cpu(work, *backend.surface);
    sink.finish();
    progress.end();
    report.index = request.search.kind;
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

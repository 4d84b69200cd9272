#include "isobrick/pipeline/extract.h"

#include <tbb/global_control.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <future>
#include <utility>
#include <vector>

#include "isobrick/pipeline/backend_choice.h"
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

/// Surface and bricks of an extraction that is under way.
struct Stages {
  BrickCache& cache;
  BatchPlanner& batches;
  SurfaceExtractor& surface;
  ExtractReport& report;

  void decode(const TileBatch& batch) const {
    Stopwatch watch(report.decode_seconds);
    cache.require(batch.bricks);
  }
  void extract(const TileBatch& batch, const BrickLookup& bricks) const {
    Stopwatch watch(report.surface_seconds);
    surface.extract(batch.tiles, bricks);
  }
};

/// Batch after batch, each decoded and then extracted: for a surface that keeps all cores
/// busy itself. Calls done(batch) after each.
template <class F>
void extract_in_turn(const Stages& stages, const F& done) {
  TileBatch batch, following;
  for (bool more = stages.batches.next(batch); more; std::swap(batch, following)) {
    stages.decode(batch);
    // The disk works on the next batch while the processors work on this one.
    more = stages.batches.next(following);
    stages.cache.will_need(following.bricks);
    stages.extract(batch, stages.cache);
    done(batch);
  }
}

/// A batch is extracted while the next is decoded, the disk reads the one after that, and
/// the one behind is planned. The cores prefer what the extraction asks of them: it is short,
/// others wait for it, and decoding fills the time between.
template <class F>
void extract_overlapped(const Stages& stages, int threads, const F& done) {
  tbb::task_arena first(threads, 1, tbb::task_arena::priority::high);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  std::array<TileBatch, 4> batches;
  stages.batches.next(batches[0]);
  tbb::parallel_invoke([&] { stages.decode(batches[0]); },
                       [&] {
                         stages.batches.next(batches[1]);
                         stages.batches.next(batches[2]);
                       });
  stages.cache.will_need(batches[1].bricks);
  stages.cache.will_need(batches[2].bricks);
  while (!batches[0].tiles.empty()) {
    const BrickView bricks = stages.cache.view(batches[0].bricks);
    tbb::parallel_invoke([&] { first.execute([&] { stages.extract(batches[0], bricks); }); },
                         [&] { stages.decode(batches[1]); },
                         [&] { stages.batches.next(batches[3]); });
    stages.cache.will_need(batches[3].bricks);
    done(batches[0]);
    std::rotate(batches.begin(), batches.begin() + 1, batches.end());
  }
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
  return {{"read", r.read},     {"decode", r.decode}, {"gather", r.gather},
          {"upload", r.upload}, {"kernel", r.kernel}, {"download", r.download},
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
    BrickCache cache(store, options.level, plan.cache_bricks);
    progress.begin("extracting", active.active_bricks * lattice.brick_bytes());
    const double bytes_per_block = static_cast<double>(active.active_bricks) *
                                   static_cast<double>(lattice.brick_bytes()) /
                                   std::max(1.0, static_cast<double>(active.active_blocks));
    const auto done = [&](const TileBatch& batch) {
      double blocks = 0;
      for (const TileWork& work : batch.tiles)
        blocks += static_cast<double>(std::popcount(work.active_blocks));
      progress.advance(static_cast<std::uint64_t>(blocks * bytes_per_block));
    };
    const Stages stages{cache, batches, *backend.surface, report};
    Workers workers(request.threads);
    workers.execute([&] {
      plan.overlap ? extract_overlapped(stages, request.threads, done)
                   : extract_in_turn(stages, done);
    });
    backend.surface->finish();
    sink.finish();
    progress.end();
    backend.surface->report(report);
    report.index = request.search.kind;
    report.search_bytes = tiles.range_bytes() + tiles.index_bytes();
    // Once for the plan and once for the surface; the index has files of its own.
    report.bytes_read = 2 * tiles.index_bytes();
    report.search_seconds = tiles.seconds();
    report.bricks_read = cache.bricks_read();
    report.brick_reads = cache.reads();
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

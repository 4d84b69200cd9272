#include "pipeline/extract/extract_pass.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "core/stopwatch.h"
#include "pipeline/extract/extract_tiles.h"
#include "pipeline/workers.h"
#include "stream/batch_lookahead.h"
#include "stream/brick_cache.h"

namespace isobrick::inline v0 {
namespace {

/// A pass that is under way.
struct Work {
  const StoreReader& store;
  const ExtractOptions& options;
  PassRequests requests;
  const ExtractPlan& plan;
  std::span<ExtractReport> reports;
  const TilesDone& done;
  std::vector<std::size_t> isovalue_of;  ///< of each request: which of isovalues_of()
};

std::vector<std::size_t> number_isovalues(PassRequests requests) {
  const std::vector<double> isovalues = isovalues_of(requests);
  std::vector<std::size_t> numbers;
  for (const ExtractRequest& request : requests)
    numbers.push_back(static_cast<std::size_t>(
        std::find(isovalues.begin(), isovalues.end(), request.surface.isovalue) -
        isovalues.begin()));
  return numbers;
}

/// Extracts what each surface has in a batch, one surface after the other: tiles_of(isovalue) are
/// its tiles.
template <class TilesOf>
void extract_batch(const Work& work, std::span<const std::unique_ptr<SurfaceExtractor>> surfaces,
                   const TilesOf& tiles_of, const BrickLookup& bricks,
                   const std::shared_ptr<const void>& samples) {
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const std::span<const TileWork> tiles = tiles_of(work.isovalue_of[i]);
    if (tiles.empty()) continue;
    {
      const Stopwatch watch(work.reports[i].surface_seconds);
      surfaces[i]->extract(tiles, bricks, samples);
    }
    work.done(i, tiles);
  }
}

/// Tiles whose bricks are there or on their way; none at the end.
struct CpuBatch {
  TileBatch batch;
  std::unique_ptr<CachedBricks> bricks;
};

/// Hands the batches of an extraction out, and their bricks.
class CpuBatches {
 public:
  CpuBatches(const Work& work, BatchPlanner& planner)
      : reader_(work.store, work.options.level),
        batches_(planner, reader_),
        cache_(work.store, work.options.level, reach_of(work.requests), work.plan.cache_bricks) {
    batches_.next(planned_);
  }

  CpuBatch next() {
    CpuBatch next{.batch = std::exchange(planned_, {})};
    if (!next.batch.tiles.empty()) batches_.next(planned_);
    return next;
  }

  /// Begins to decode a batch's bricks; the disk works on those of the batch after it.
  void begin(CpuBatch& batch) {
    if (batch.batch.tiles.empty()) return;
    batch.bricks = cache_.begin(batch.batch.bricks, batch.batch.tiles.back().tile);
    if (!reader_.reads_network()) cache_.will_need(*batch.bricks, planned_.bricks);
  }

  const BrickCache& cache() const { return cache_; }

 private:
  const BrickReader reader_;
  BatchLookahead batches_;
  BrickCache cache_;
  TileBatch planned_;
};

void report_surface(const SurfaceExtractor& surface, ExtractReport& report) {
  static_cast<SurfaceReport&>(report) = surface.report();
}

/// Threads' time of reading and decoding so far.
double bricks_seconds(const StoreReader& store) {
  const BrickTimes times = store.brick_times();
  return times.read_seconds + times.decode_seconds;
}

/// While the surfaces of one batch are made the bricks of the next are decoded, by the same
/// threads: where the one has nothing to do for them just then, the other has.
void extract_on_cpu(const Work& work, std::span<const std::unique_ptr<SurfaceExtractor>> surfaces) {
  PlannedTiles planned(tiles_of(work.store, work.options.level, work.requests), work.requests,
                       work.plan);
  double decode_seconds = 0, extract_seconds = 0, decoded_beside = 0;  // the last: of threads
  const bool room_for_two = work.plan.cache_bricks >= 2 * work.plan.batch_bricks;
  const int threads = work.requests.front().threads;
  Workers workers(threads);
  workers.execute([&] {
    CpuBatches batches(work, planned.batches);
    CpuBatch now = batches.next();
    batches.begin(now);
    while (now.bricks) {
      CpuBatch next = batches.next();
      if (room_for_two) batches.begin(next);
      {
        const Stopwatch watch(decode_seconds);
        now.bricks->wait();
      }
      const double decoded_before = bricks_seconds(work.store);
      {
        const Stopwatch watch(extract_seconds);
        extract_batch(
            work, surfaces,
            [&](std::size_t i) { return std::span<const TileWork>(now.batch.tiles_of[i]); },
            *now.bricks, nullptr);
      }
      decoded_beside += bricks_seconds(work.store) - decoded_before;
      now.bricks.reset();
      if (!room_for_two) batches.begin(next);
      now = std::move(next);
    }
    report_bricks(batches.cache().bricks_read(), batches.cache().reads(), decode_seconds,
                  work.reports);
  });
  for (const auto& surface : surfaces) surface->finish();
  // Of the decoding that went on meanwhile every surface had its share.
  const double share = decoded_beside / threads / std::max(extract_seconds, 1e-9);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    report_surface(*surfaces[i], work.reports[i]);
    double& seconds = work.reports[i].surface.seconds;
    seconds = std::max(0.0, seconds * (1 - share));
  }
  report_search(planned.tiles, work.reports);
}

/// All cores decode, ahead of the GPU; this thread sends batches off as they are decoded.
void extract_on_gpu(const Work& work, ChosenBackend& backend) {
  BatchDecoder& decoder = backend.decoded->decoder;
  double decode_seconds = 0;
  for (;;) {
    std::shared_ptr<const DecodedBatch> batch;
    {
      const Stopwatch watch(decode_seconds);
      batch = decoder.next();
    }
    if (!batch) break;
    extract_batch(
        work, backend.surfaces, [&](std::size_t i) { return batch->tiles_of(i); }, *batch, batch);
  }
  for (const auto& surface : backend.surfaces) surface->finish();
  for (std::size_t i = 0; i < backend.surfaces.size(); ++i) {
    report_surface(*backend.surfaces[i], work.reports[i]);
    backend.gpu->report(work.reports[i]);
    if (backend.gpu->pool_bricks() == 0) work.reports[i].pinned_bytes += decoder.memory_bytes();
  }
  report_bricks(decoder.bricks_read(), decoder.reads(), decode_seconds, work.reports);
  report_search(backend.decoded->planned.tiles, work.reports);
  // Their memory is freed before the sinks end their files.
  backend.surfaces.clear();
  backend.decoded.reset();
}

}  // namespace

void report_search(const TileStream& tiles, std::span<ExtractReport> reports) {
  for (ExtractReport& report : reports) {
    report.search_bytes = tiles.range_bytes() + tiles.index_bytes();
    // Once for the plan and once for the surface; the index has files of its own.
    report.bytes_read = 2 * tiles.index_bytes();
    report.search_seconds = tiles.seconds();
  }
}

void report_bricks(std::uint64_t bricks_read, std::uint64_t reads, double decode_seconds,
                   std::span<ExtractReport> reports) {
  for (ExtractReport& report : reports) {
    report.bricks_read = bricks_read;
    report.brick_reads = reads;
    report.decode_seconds = decode_seconds;
  }
}

void run_pass(const StoreReader& store, const ExtractOptions& options, ChosenBackend& backend,
              const PassSurfaces& surfaces, const TilesDone& done) {
  const Work work{store,
                  options,
                  surfaces.requests,
                  backend.plan,
                  surfaces.reports,
                  done,
                  number_isovalues(surfaces.requests)};
  if (backend.gpu)
    extract_on_gpu(work, backend);
  else
    extract_on_cpu(work, backend.surfaces);
}

}  // namespace isobrick

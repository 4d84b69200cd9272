#include <isobrick/extract.h>

#include <algorithm>
#include <bit>
#include <future>
#include <utility>
#include <vector>

#include <isobrick/estimate.h>
#include <isobrick/mesh_sinks.h>
#include "core/cancellable_progress.h"
#include "core/stopwatch.h"
#include "pipeline/extract/backend_choice.h"
#include "pipeline/extract/extract_part.h"
#include "pipeline/extract/extract_pass.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/extract/extract_tiles.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/extract/resident_pass.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

/// What becomes of a device and of the search for tiles while the active parts are counted.
struct EarlyWork {
  std::future<std::unique_ptr<GpuSession>> gpu;
  std::future<TileStream> tiles;
};

/// A device takes some tenths of a second to open: when it is known that there will be one, that
/// goes on while the active parts are counted, and the first tiles are found.
EarlyWork begin_early(const StoreReader& store, const ExtractOptions& options,
                      PassRequests requests) {
  EarlyWork early;
  if (options.backend != Backend::cuda || !use_cuda(requests.front(), options, 0)) return early;
  early.gpu = std::async(std::launch::async, open_gpu, options.device);
  early.tiles = std::async(std::launch::async, [&store, level = options.level, requests] {
    TileStream tiles = tiles_of(store, level, requests);
    Workers(requests.front().threads).execute([&] { tiles.begin(); });
    return tiles;
  });
  return early;
}

/// The surfaces of one extract().
class Extraction {
 public:
  Extraction(const StoreReader& store, const ExtractOptions& options,
             std::span<const SurfaceOutput> outputs, const std::optional<RequestedPart>& part = {})
      : store_(store), options_(options), reports_(outputs.size()) {
    for (const SurfaceOutput& output : outputs) {
      options_.isovalue = output.isovalue;
      options_.normals = output.normals;
      requests_.push_back(check_request(store, options_, output.sink->indexing()));
      requests_.back().sink_bytes = output.sink->memory();
      requests_.back().part = part;
      sinks_.push_back(output.sink);
    }
    other_bytes_ =
        decode_extra(store.info(), requests_.front().threads) + store.storage()->memory();
  }

  std::vector<ExtractReport> run(Progress& progress) {
    double count_seconds = 0;
    {
      const Stopwatch watch(count_seconds);
      begin();
    }
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < requests_.size(); ++i) bytes += active_bytes(i);
    progress.begin("extracting", bytes);
    std::size_t made = 0;
    for (std::size_t pass = 0; made < requests_.size(); ++pass) {
      const std::size_t first = made;
      made += run_next(first, pass, progress);
      for (std::size_t i = first; i < made && pass == 0; ++i) {
        reports_[i].plan_seconds += count_seconds;
        reports_[i].seconds += count_seconds;
      }
    }
    progress.end();
    return std::move(reports_);
  }

 private:
  /// Of a surface's active bricks, what lies in so many active blocks.
  std::uint64_t bytes_of_blocks(std::uint64_t blocks, std::size_t surface) const {
    const ExtractRequest& request = requests_[surface];
    const std::uint64_t all = request.active_bricks * request.level->lattice.brick_bytes();
    const std::uint64_t of = std::max<std::uint64_t>(1, active_[surface].active_blocks);
    return static_cast<std::uint64_t>(static_cast<double>(blocks) / static_cast<double>(of) *
                                      static_cast<double>(all));
  }

  std::uint64_t active_bytes(std::size_t surface) const {
    const auto& part = requests_[surface].part;
    return bytes_of_blocks(part ? part->active_blocks : active_[surface].active_blocks, surface);
  }

  /// Counts what is active, and refuses a budget that is too small for any of the surfaces.
  void begin() {
    bytes_before_ = store_.bytes_read();
    early_ = begin_early(store_, options_, requests_);
    const std::vector<double> isovalues = isovalues_of(requests_);
    const std::vector<ActiveParts> counted = count_active(store_, options_, isovalues);
    std::uint64_t blocks = 0;
    for (ExtractRequest& request : requests_) {
      const auto at = std::find(isovalues.begin(), isovalues.end(), request.surface.isovalue);
      active_.push_back(counted[static_cast<std::size_t>(at - isovalues.begin())]);
      request.active_bricks = active_.back().active_bricks;
      blocks += active_.back().active_blocks;
      if (options_.backend != Backend::cuda)
        plan_memory({&request, 1}, options_.memory, other_bytes_);
    }
    use_gpu_ = early_.gpu.valid() || use_cuda(requests_.front(), options_, blocks);
  }

  TileStream take_tiles(PassRequests requests) {
    // What was begun early is for all surfaces.
    const bool is_begun = early_.tiles.valid() && requests.size() == requests_.size();
    return is_begun ? early_.tiles.get() : tiles_of(store_, options_.level, requests);
  }

  ChosenBackend set_up(const PassSurfaces& left) {
    return set_up_backend(
        left.requests, options_, other_bytes_, left.sinks,
        [&]() -> std::unique_ptr<GpuSession> {
          if (early_.gpu.valid()) return early_.gpu.get();
          return use_gpu_ ? open_gpu(options_.device) : nullptr;
        },
        [&](PassRequests requests, const ExtractPlan& plan, GpuSession& gpu) {
          return std::make_unique<DecodedTiles>(store_, options_.level, take_tiles(requests),
                                                requests, plan, gpu.bricks());
        });
  }

  /// Makes as many of the surfaces from `first` on as one pass has room for; how many.
  std::size_t run_next(std::size_t first, std::size_t pass, Progress& progress) {
    const PassSurfaces left = PassSurfaces{requests_, sinks_, reports_}.after(first);
    const BrickTimes times_before = store_.brick_times();
    if (first > 0) bytes_before_ = store_.bytes_read();
    double seconds = 0, plan_seconds = 0;
    std::size_t count = 0;
    {
      const Stopwatch whole(seconds);
      if (first == 0 && use_gpu_ && can_be_resident(requests_))
        count = make_resident(left, progress);
      if (count == 0) count = stream(left, first, plan_seconds, progress);
    }
    const PassSurfaces made = left.first(count);
    complete(made, first, times_before);
    for (ExtractReport& report : made.reports) {
      report.pass = pass;
      report.seconds = seconds;
      report.plan_seconds = plan_seconds;
    }
    return made.requests.size();
  }

  std::size_t make_resident(const PassSurfaces& left, Progress& progress) {
    const ResidentPassResult result = run_resident_pass(
        store_, options_, left, take_tiles(requests_), other_bytes_,
        [&](std::size_t i) { begin_sink(i); }, progress);
    progress_ahead_ = result.progress_ahead;
    return result.made;
  }

  /// Streams as many of `left`, the surfaces from `first` on, as fit together; how many.
  std::size_t stream(const PassSurfaces& left, std::size_t first, double& plan_seconds,
                     Progress& progress) {
    ChosenBackend backend;
    {
      const Stopwatch watch(plan_seconds);
      backend = set_up(left);
    }
    const PassSurfaces made = left.first(backend.surfaces.size());
    for (std::size_t i = 0; i < made.sinks.size(); ++i) begin_sink(first + i);
    run_pass(store_, options_, backend, made, [&](std::size_t i, std::span<const TileWork> tiles) {
      const std::uint64_t bytes = bytes_of(tiles, first + i);
      const std::uint64_t known = std::min(progress_ahead_, bytes);
      progress_ahead_ -= known;
      progress.advance(bytes - known);
    });
    for (ExtractReport& report : made.reports) report.gpu_refusal = backend.gpu_refusal;
    // Their buffers are freed before the sinks end their files.
    backend.surfaces.clear();
    for (MeshSink* sink : made.sinks) sink->finish();
    return made.sinks.size();
  }

  void begin_sink(std::size_t surface) {
    const ExtractRequest& request = requests_[surface];
    sinks_[surface]->begin(mesh_header(request.level->transform, request.level->lattice.extent,
                                       request.surface.normals, active_[surface].bounds));
  }

  /// Of a surface's active bricks, the part that lies in these tiles.
  std::uint64_t bytes_of(std::span<const TileWork> tiles, std::size_t surface) const {
    const auto& part = requests_[surface].part;
    std::uint64_t blocks = 0;
    for (const TileWork& tile : tiles)
      if (!part || part->tiles.contains(tile.tile))
        blocks += static_cast<std::uint64_t>(std::popcount(tile.active_blocks));
    return bytes_of_blocks(blocks, surface);
  }

  /// Adds to the reports of a pass what is known of its surfaces and what the store counted.
  void complete(const PassSurfaces& made, std::size_t first, const BrickTimes& before) const {
    const BrickTimes times = store_.brick_times();
    for (std::size_t i = 0; i < made.reports.size(); ++i) {
      ExtractReport& report = made.reports[i];
      report.bricks = active_[first + i].bricks;
      report.active_bricks = active_[first + i].active_bricks;
      report.index = made.requests[i].search.kind;
      const int threads = made.requests[i].threads;
      report.read = {(times.read_seconds - before.read_seconds) / threads,
                     times.bytes_read - before.bytes_read};
      report.decode = {(times.decode_seconds - before.decode_seconds) / threads,
                       times.bytes_decoded - before.bytes_decoded};
      report.bytes_read += store_.bytes_read() - bytes_before_;
    }
  }

  const StoreReader& store_;
  ExtractOptions options_;
  std::vector<ExtractRequest> requests_;
  std::vector<MeshSink*> sinks_;
  std::vector<ActiveParts> active_;
  std::vector<ExtractReport> reports_;
  std::uint64_t other_bytes_ = 0, bytes_before_ = 0;
  std::uint64_t progress_ahead_ = 0;  ///< reported already for what is streamed
  bool use_gpu_ = false;
  EarlyWork early_;
};

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

ExtractReport extract_part(const StoreReader& store, const ExtractOptions& options,
                           const RequestedPart& part, MeshSink& sink, Progress& progress) {
  CancellableProgress cancellable(progress, options.cancel);
  const SurfaceOutput output{options.isovalue, options.normals, &sink};
  return Extraction(store, options, {&output, 1}, part).run(cancellable).front();
}

std::uint64_t min_extract_memory(const StoreReader& store, const ExtractOptions& options,
                                 Indexing indexing, std::uint64_t sink_bytes) {
  ExtractRequest request = check_request(store, options, indexing);
  request.sink_bytes = sink_bytes;
  return least_memory({&request, 1},
                      decode_extra(store.info(), request.threads) + store.storage()->memory());
}

ExtractReport extract(const StoreReader& store, const ExtractOptions& options, MeshSink& sink,
                      Progress& progress) {
  const SurfaceOutput output{options.isovalue, options.normals, &sink};
  return extract(store, options, {&output, 1}, progress).front();
}

Mesh extract(const StoreReader& store, const ExtractOptions& options, Progress& progress) {
  Mesh mesh;
  MemorySink sink(mesh);
  extract(store, options, sink, progress);
  return mesh;
}

std::vector<ExtractReport> extract(const StoreReader& store, const ExtractOptions& options,
                                   std::span<const SurfaceOutput> outputs, Progress& progress) {
  if (outputs.empty()) return {};
  CancellableProgress cancellable(progress, options.cancel);
  return Extraction(store, options, outputs).run(cancellable);
}

}  // namespace isobrick

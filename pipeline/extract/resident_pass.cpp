#include "pipeline/extract/resident_pass.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/device_volume.h>
#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "pipeline/extract/device_loader.h"
#include "pipeline/extract/sink_writers.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

/// The driver gets memory that is allocated in the order of a stream in pieces of so much.
constexpr std::uint64_t kPieceOfDriver = std::uint64_t{32} << 20;

class ResidentPass {
 public:
  ResidentPass(DeviceLoader& loader, const ExtractOptions& options, const PassSurfaces& surfaces,
               const ExtractPlan& plan, const gpu::DeviceInfo& device, Progress& progress)
      : options_(options),
        surfaces_(surfaces),
        plan_(plan),
        device_(device),
        progress_(progress),
        loader_(loader),
        budget_(options.gpu_memory > 0 ? options.gpu_memory
                                       : device.free_bytes - device.free_bytes / 10) {}

  /// False where the device has no room, or fails: then streaming has its turn.
  bool load(TileStream& stream) {
    const std::uint64_t max_tiles = budget_ / (kTileVolume * lattice().sample_bytes());
    const std::optional<SurfaceTiles> tiles =
        find_surface_tiles(stream, lattice(), reach_of(surfaces_.requests), max_tiles);
    if (!tiles) return false;
    report_search(stream, surfaces_.reports);
    const gpu::ResidentSizes sizes =
        gpu::resident_sizes(lattice(), tiles->count(), any_normals(), any_on_samples(),
                            common().surface.topology == Topology::trilinear);
    const std::uint64_t beside = std::max(sizes.extractor_bytes, loader_.device_bytes());
    if (sizes.volume_bytes + beside + kPieceOfDriver > budget_) return false;
    try {
      volume_.emplace(lattice(), common().surface.fill_value,
                      gpu::DeviceTiles{tiles->searched, tiles->loaded});
      read(tiles->loaded);
    } catch (const DamageError&) {
      throw;
    } catch (const Cancelled&) {
      throw;
    } catch (const Error&) {
      return false;
    }
    return true;
  }

  /// Makes the surfaces from the first on, as many as the device has room for. A kernel takes
  /// milliseconds and a file seconds, so several files are written at a time.
  std::size_t make(const std::function<void(std::size_t)>& begin) {
    std::size_t made = 0;
    while (made < surfaces_.requests.size()) {
      extract_from(made);
      if (extractors_.empty() || !reserve_chunks()) break;
      for (std::size_t i = 0; i < extractors_.size(); ++i) begin(made + i);
      write_from(made);
      made += extractors_.size();
    }
    return made;
  }

  /// Progress that was reported for surfaces that were not made.
  std::uint64_t progress_ahead(std::size_t made) const {
    std::uint64_t of_made = 0;
    for (std::size_t i = 0; i < made; ++i) of_made += bytes_of(surfaces_.requests[i]) / 2;
    return shown_ - std::min(shown_, of_made);
  }

 private:
  const ExtractRequest& common() const { return surfaces_.requests.front(); }
  const Lattice& lattice() const { return common().level->lattice; }
  bool any_normals() const {
    return std::any_of(surfaces_.requests.begin(), surfaces_.requests.end(),
                       [](const ExtractRequest& r) { return r.surface.normals; });
  }
  bool any_on_samples() const {
    return std::any_of(
        surfaces_.requests.begin(), surfaces_.requests.end(),
        [](const ExtractRequest& r) { return r.surface.drop_degenerate || r.surface.cap; });
  }

  std::uint64_t bytes_of(const ExtractRequest& request) const {
    return request.active_bricks * lattice().brick_bytes();
  }

  /// Extracts the surfaces from `first` on: as many as the device has room for together, and as
  /// are written at a time.
  void extract_from(std::size_t first) {
    extractors_.clear();
    const std::size_t count = std::min(plan_.sinks, surfaces_.requests.size() - first);
    std::uint64_t room = budget_ - kPieceOfDriver - volume_->bytes();
    for (std::size_t i = first; i < first + count; ++i) try {
        const SurfaceOptions& surface = surfaces_.requests[i].surface;
        const Stopwatch watch(surfaces_.reports[i].surface_seconds);
        auto extractor = std::make_unique<gpu::ResidentExtractor>(*volume_, surface,
                                                                  gpu::ResidentTuning{}, room);
        const gpu::DeviceCounts made = extractor->extract(surface.isovalue);
        surfaces_.reports[i].vertices = made.vertices;
        surfaces_.reports[i].triangles = made.triangles;
        surfaces_.reports[i].degenerate_triangles = made.degenerate_triangles;
        room -= std::min(room, extractor->bytes());
        extractors_.push_back(std::move(extractor));
      } catch (const Error&) {
        return;  // its sink has not begun: streaming makes it, or reports the error
      }
  }

  std::size_t chunk_bytes() const { return plan_.limits.output_bytes / extractors_.size(); }

  /// False where there is no pinned memory, before any sink begins.
  bool reserve_chunks() const {
    try {
      for (const auto& extractor : extractors_) extractor->reserve_chunks(chunk_bytes());
    } catch (const Error&) {
      return false;
    }
    return true;
  }

  /// Writes what was extracted to the sinks from `first` on.
  void write_from(std::size_t first) {
    write_together(
        surfaces_.sinks.subspan(first, extractors_.size()),
        [&](std::size_t i, MeshSink& sink) {
          const Stopwatch watch(surfaces_.reports[first + i].surface_seconds);
          extractors_[i]->write(sink, chunk_bytes());
        },
        [&](std::size_t i, std::uint64_t bytes) { advance(first + i, bytes); });
    for (std::size_t i = 0; i < extractors_.size(); ++i)
      add_report(surfaces_.reports[first + i], *extractors_[i]);
  }

  /// The second half of a surface's progress is that its mesh is written.
  void advance(std::size_t surface, std::uint64_t bytes) {
    const ExtractRequest& request = surfaces_.requests[surface];
    const MeshSize size{surfaces_.reports[surface].vertices, surfaces_.reports[surface].triangles};
    const std::uint64_t all = std::max<std::uint64_t>(1, mesh_bytes(size, request.surface.normals));
    const double part = static_cast<double>(bytes) / static_cast<double>(all);
    progress_.advance(
        static_cast<std::uint64_t>(part * static_cast<double>(bytes_of(request) / 2)));
  }

  void read(std::span<const Int3> tiles) {
    std::uint64_t bytes = 0;
    for (const ExtractRequest& request : surfaces_.requests) bytes += bytes_of(request);
    loader_.load(*volume_, tiles, plan_.limits.tiles, [&](std::size_t done) {
      // Half of the way is that the samples are there.
      const auto part = static_cast<double>(done) / static_cast<double>(tiles.size());
      const auto now = static_cast<std::uint64_t>(part * static_cast<double>(bytes / 2));
      progress_.advance(now - std::exchange(shown_, now));
    });
    report_bricks(loader_.bricks_read(), loader_.reads(), loader_.wait_seconds(),
                  surfaces_.reports);
  }

  void add_report(ExtractReport& report, const gpu::ResidentExtractor& extractor) const {
    static_cast<SurfaceReport&>(report) = extractor.report();
    report.upload = loader_.upload();
    report.device_bytes += volume_->bytes();
    report.backend = "cuda";
    report.device = device_.name;
    report.resident = true;
    const std::uint64_t free = gpu::open_device(options_.device).free_bytes;
    report.device_bytes_in_use = device_.free_bytes - std::min(free, device_.free_bytes);
  }

  const ExtractOptions& options_;
  const PassSurfaces& surfaces_;
  const ExtractPlan& plan_;
  const gpu::DeviceInfo& device_;
  Progress& progress_;
  DeviceLoader& loader_;
  std::uint64_t budget_;     ///< of device memory
  std::uint64_t shown_ = 0;  ///< progress of loading
  std::optional<gpu::DeviceVolume> volume_;
  std::vector<std::unique_ptr<gpu::ResidentExtractor>> extractors_;  ///< with the meshes to write
};

}  // namespace

ResidentPassResult run_resident_pass(const StoreReader& store, const ExtractOptions& options,
                                     const PassSurfaces& surfaces, TileStream tiles,
                                     std::uint64_t other_bytes,
                                     const std::function<void(std::size_t)>& begin,
                                     Progress& progress) {
  DeviceLoader loader(store, options.level, surfaces.requests.front(), options.device);
  const auto plan =
      plan_resident_memory(surfaces.requests, options.memory, other_bytes + loader.pinned_bytes());
  if (!plan) return {};
  return Workers(surfaces.requests.front().threads).execute([&]() -> ResidentPassResult {
    gpu::DeviceInfo device;
    try {
      device = gpu::open_device(options.device);
    } catch (const Error&) {
      return {};  // streaming, which is next, reports it
    }
    ResidentPass pass(loader, options, surfaces, *plan, device, progress);
    const std::size_t made = pass.load(tiles) ? pass.make(begin) : 0;
    return {made, pass.progress_ahead(made)};
  });
}

}  // namespace isobrick

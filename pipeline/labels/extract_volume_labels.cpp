#include <isobrick/labels.h>

#include <algorithm>
#include <mutex>
#include <vector>

#include <fmt/format.h>
#include <tbb/info.h>

#include <isobrick/error.h>
#include "core/morton.h"
#include "core/stopwatch.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/labels/label_meshes.h"
#include "pipeline/labels/label_pass.h"
#include "pipeline/volume/volume_samples.h"

namespace isobrick::inline v0 {
namespace {

/// Tiles that are listed at a time.
constexpr std::size_t kTilesAtOnce = 4096;

/// Samples behind a function, which is called for each tile.
class ReadSamples final : public TileSamples {
 public:
  /// `volume` must outlive it.
  explicit ReadSamples(const VolumeSamples& volume) : volume_(volume) {}

  void gather(const TileWork& work, Index reach, const TileBlock& block) const override {
    const Int3 around{reach, reach, reach}, tile = work.tile * kTileEdge;
    constexpr Index samples = kTileEdge + 1;
    const Box3 box = intersect({tile - around, tile + around + Int3{samples, samples, samples}},
                               volume_.lattice.box());
    std::vector<std::byte> read(static_cast<std::size_t>(isobrick::volume(box.extent())) *
                                size_of(volume_.read_type));
    {
      std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
      if (!volume_.concurrent) lock.lock();
      volume_.read(box, read.data());
    }
    const auto bytes = static_cast<Index>(size_of(volume_.read_type));
    const Int3 n = box.extent();
    const SampleArray array{
        read.data(), box, {bytes, bytes * n.x, bytes * n.x * n.y}, volume_.read_type};
    ArraySamples(volume_.lattice.extent, array, volume_.missing, volume_.use)
        .gather(work, reach, block);
  }

 private:
  const VolumeSamples& volume_;
  mutable std::mutex mutex_;
};

/// Bytes that the tiles under way take where a function reads their samples.
std::uint64_t read_bytes(const VolumeSamples& samples, const LabelOptions& options) {
  if (samples.array) return 0;
  const int threads = options.threads > 0 ? options.threads : tbb::info::default_concurrency();
  const auto edge = static_cast<std::uint64_t>(LabelWindow(label_smoothing(options).reach()).edge);
  return static_cast<std::uint64_t>(threads) * edge * edge * edge * size_of(samples.read_type);
}

}  // namespace

LabelReport extract_labels(const Volume& volume, const LabelOptions& options,
                           const LabelVisitor& visit, Progress& progress) {
  if (options.level != 0)
    throw UsageError(fmt::format("a volume without a store has no level {}", options.level));
  LabelReport report;
  double seconds = 0;
  {
    const Stopwatch watch(seconds);
    const VolumeSamples samples(volume, SampleUse::labels);
    check_transform(samples.transform, samples.lattice.extent, "the volume");
    const LabelPlan plan =
        plan_label_memory(samples.lattice.type, read_bytes(samples, options), options);
    const LabelImage image{.name = "the volume",
                           .extent = samples.lattice.extent,
                           .type = samples.lattice.type,
                           .transform = samples.transform,
                           .roi = options.roi.value_or(samples.lattice.box()),
                           .labels = {options.labels, options.background},
                           .smoothing = label_smoothing(options)};
    LabelMeshes meshes(image, {options.scratch_beside, plan.label_bytes, plan.meshes,
                               options.cancel, options.check_totals});
    LabelPass pass(
        image, options, plan, [&](std::span<const std::byte> packed) { meshes.append(packed); },
        progress);
    const Box3 tiles = image.tiles();
    pass.begin(static_cast<std::uint64_t>(isobrick::volume(tiles.extent())));
    const ReadSamples read(samples);
    const TileSamples& source =
        samples.array ? static_cast<const TileSamples&>(*samples.array) : read;
    std::vector<TileWork> some;
    const auto make = [&] {
      pass.workers().execute([&] { pass.make(some, source); });
      some.clear();
    };
    for_each_morton(tiles.hi, [&](Int3 tile) {
      if (!tiles.contains(tile)) return;
      some.push_back({tile, 0xff});
      if (some.size() == kTilesAtOnce) make();
    });
    make();
    pass.end();
    report = meshes.finish(pass.workers(), visit, progress);
  }
  report.seconds = seconds;
  return report;
}

}  // namespace isobrick

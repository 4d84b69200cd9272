#include <isobrick/volume_extractor.h>

#include "core/cancellable_progress.h"
#include "pipeline/histogram/histogram.h"
#include "pipeline/volume/volume_histogram.h"
#include "pipeline/volume/volume_pass.h"

namespace isobrick::inline v0 {

struct VolumeExtractor::Impl {
  VolumeSamples samples;
  std::shared_ptr<TileWorkSpaces> spaces = std::make_shared<TileWorkSpaces>();

  template <class Source>
  explicit Impl(Source& source) : samples(source) {}

  template <class Output>
  SurfaceReport extract(const ExtractOptions& options, Indexing indexing, Output& output,
                        Progress& progress) {
    CancellableProgress cancellable(progress, options.cancel);
    return VolumePass(samples, options, indexing, spaces).run(output, cancellable);
  }
};

VolumeExtractor::VolumeExtractor(const Volume& volume) : impl_(std::make_unique<Impl>(volume)) {}
VolumeExtractor::VolumeExtractor(VolumeSource& source) : impl_(std::make_unique<Impl>(source)) {}
VolumeExtractor::~VolumeExtractor() = default;
VolumeExtractor::VolumeExtractor(VolumeExtractor&&) noexcept = default;

SurfaceReport VolumeExtractor::extract(const ExtractOptions& options, MeshSink& sink,
                                       Progress& progress) {
  return impl_->extract(options, sink.indexing(), sink, progress);
}

SurfaceReport VolumeExtractor::extract(const ExtractOptions& options, Mesh& mesh,
                                       Progress& progress) {
  return impl_->extract(options, Indexing::welded, mesh, progress);
}

std::optional<ValueRange<double>> VolumeExtractor::range() const {
  if (!impl_->samples.is_known(impl_->samples.all_tiles())) return std::nullopt;
  const ValueRange<double> all = impl_->samples.ranges->all();
  return all.empty() ? std::nullopt : std::optional(all);
}

Histogram VolumeExtractor::histogram(int threads, Progress& progress) {
  Workers workers(threads);
  return histogram_of(count_samples(impl_->samples, workers, progress),
                      impl_->samples.lattice.type);
}

Mesh extract(const Volume& volume, const ExtractOptions& options, Progress& progress) {
  Mesh mesh;
  VolumeExtractor(volume).extract(options, mesh, progress);
  return mesh;
}

SurfaceReport extract(const Volume& volume, const ExtractOptions& options, MeshSink& sink,
                      Progress& progress) {
  return VolumeExtractor(volume).extract(options, sink, progress);
}

}  // namespace isobrick

#pragma once

#include <memory>
#include <optional>

#include <isobrick/api.h>
#include <isobrick/extract.h>
#include <isobrick/histogram.h>
#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include <isobrick/range.h>
#include <isobrick/surface_report.h>
#include <isobrick/volume.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// Isosurfaces of a volume without a store. The first extraction finds the ranges of the blocks of
/// 16³ cells, later ones read only what their isovalue touches. The mesh is that of a store of the
/// same samples. No surface touches missing samples: they count as NaN.
///
/// Samples in memory are read in place. Those behind a function, or of a source with random access,
/// are read box by box, each once with a layer or two of its neighbours'. One operation at a time.
///
/// Of ExtractOptions, `index` and the budget of a GPU do not matter; `inside` is above by default.
/// `level` other than 0 and Backend::cuda are refused. `memory` bounds all but the mesh of an
/// extraction into a Mesh.
class ISOBRICK_API VolumeExtractor {
 public:
  /// Throws UsageError for a volume that makes no sense: no samples, an extent that is not
  /// positive, overflows or exceeds 2²⁶ along an axis, a stride of 0 along an axis of several
  /// samples.
  explicit VolumeExtractor(const Volume& volume);
  /// Of a source, which must outlive it. Throws UsageError for one without random access.
  explicit VolumeExtractor(VolumeSource& source);
  ~VolumeExtractor();
  /// Takes the ranges of another.
  VolumeExtractor(VolumeExtractor&&) noexcept;

  /// Streams a surface into `sink` (begin … finish). Throws UsageError for a region, a transform or
  /// an isovalue that makes no sense and a budget that is too small, what the sink, `read` and the
  /// progress throw.
  SurfaceReport extract(const ExtractOptions& options, MeshSink& sink,
                        Progress& progress = no_progress());
  /// Puts a welded surface in place of what `mesh` held, in its memory where that is enough. After
  /// an exception the mesh is empty or as it was; its memory and resource are still its own.
  SurfaceReport extract(const ExtractOptions& options, Mesh& mesh,
                        Progress& progress = no_progress());

  /// The smallest and the largest sample, missing ones left out. nullopt before all samples were
  /// scanned (the first extraction without a region does), and where all are missing.
  std::optional<ValueRange<double>> range() const;

  /// The histogram of all samples, in as many bins as a store keeps: what resolve_isovalue() and
  /// suggest_isovalue() need. Missing samples count as NaN. Reads every sample once. Takes some 64
  /// MiB at most. `threads`: 0 means all cores. Throws what `read` and the progress throw.
  Histogram histogram(int threads = 0, Progress& progress = no_progress());

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A surface of a volume in one go: VolumeExtractor.
ISOBRICK_API Mesh extract(const Volume& volume, const ExtractOptions& options,
                          Progress& progress = no_progress());
/// The same into a sink.
ISOBRICK_API SurfaceReport extract(const Volume& volume, const ExtractOptions& options,
                                   MeshSink& sink, Progress& progress = no_progress());

}  // namespace isobrick

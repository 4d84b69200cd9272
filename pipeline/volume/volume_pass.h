#pragma once

#include <memory>

#include <isobrick/extract.h>
#include "pipeline/volume/volume_samples.h"
#include "pipeline/workers.h"
#include "surface/cpu_extractor.h"

namespace isobrick::inline v0 {

/// One surface of a volume without a store.
class VolumePass {
 public:
  /// Checks the options. All must outlive it.
  VolumePass(VolumeSamples& samples, const ExtractOptions& options, Indexing indexing,
             std::shared_ptr<TileWorkSpaces> spaces);

  /// Streams the surface to the sink.
  SurfaceReport run(MeshSink& sink, Progress& progress);
  /// Puts it in place of what `mesh` held.
  SurfaceReport run(Mesh& mesh, Progress& progress);

 private:
  void plan(bool has_sink, std::uint64_t sink_bytes);
  std::uint64_t fixed_bytes() const;
  CapBounds bounds_of_cap() const;
  Box3 tiles_of_roi() const;
  std::uint64_t sample_bytes(Box3 tiles) const;
  void find_ranges(Progress& progress);
  void append_tiles(Box3 tiles, std::vector<TileWork>& out) const;
  std::vector<TileWork> active_tiles() const;
  Box3 active_cells(const std::vector<TileWork>& tiles) const;
  void prepare(Progress& progress);
  void extract(CpuExtractor& extractor, Progress& progress);
  void extract_array(CpuExtractor& extractor, Progress& progress);
  template <class F>
  void for_each_region(F&& f) const;
  void extract_regions(CpuExtractor& extractor, Progress& progress);
  void extract_region(CpuExtractor& extractor, const SampleArray& read, Box3 tiles);

  VolumeSamples& samples_;
  SurfaceOptions surface_;
  std::uint64_t memory_, others_;  ///< the budget, and what others take of it
  Workers workers_;
  std::shared_ptr<TileWorkSpaces> spaces_;
  ExtractorLimits limits_;
  Index region_tiles_ = 1;       ///< edge of the regions that are read
  std::vector<TileWork> tiles_;  ///< the active ones, where they are known before
};

}  // namespace isobrick

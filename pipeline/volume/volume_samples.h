#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <isobrick/volume.h>
#include <isobrick/volume_source.h>
#include "pipeline/volume/array_samples.h"
#include "pipeline/volume/region_reader.h"
#include "pipeline/volume/volume_ranges.h"

namespace isobrick::inline v0 {

/// Throws UsageError where it is not positive, overflows or exceeds kMaxAxisSamples: what stores
/// refuse too.
void check_extent(Int3 extent);
/// The strides as given, or those of samples without gaps where all are 0. `bytes` along an axis of
/// one sample, so that it never keeps samples from being read in place. Throws UsageError where
/// another is 0; `what` they are of.
Int3 resolve_strides(Int3 strides, Int3 extent, Index bytes, const char* what);

/// A volume that is extracted without a store: where its samples are, and what is known of them.
struct VolumeSamples {
  Lattice lattice;  ///< of the samples as they are extracted; the brick is of no matter
  Transform transform;
  MissingSamples missing;
  std::optional<ArraySamples> array;  ///< all samples, where they are in memory
  // Else what reads them, of this type:
  RegionReader::Read read;
  bool concurrent = false;
  ScalarType read_type = ScalarType::u8;
  SampleUse use = SampleUse::surfaces;
  std::uint64_t source_bytes = 0;  ///< VolumeSource::memory()

  std::unique_ptr<VolumeRanges> ranges;  ///< null before make_ranges()
  std::vector<bool> known;               ///< of each tile, C order: whether its ranges are found

  /// Throw UsageError for what VolumeExtractor refuses.
  explicit VolumeSamples(const Volume& volume, SampleUse use = SampleUse::surfaces);
  explicit VolumeSamples(VolumeSource& source);

  /// Bytes that make_ranges() takes.
  std::uint64_t range_bytes() const;
  /// Makes room for what is found of the samples. Not done by the constructor: a budget comes
  /// first.
  void make_ranges();

  bool is_known(Box3 tiles) const;
  void set_known(Box3 tiles);
  Box3 all_tiles() const { return {{0, 0, 0}, lattice.tiles()}; }
};

}  // namespace isobrick

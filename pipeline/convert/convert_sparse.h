#pragma once

#include <cstdint>
#include <filesystem>

#include <isobrick/convert.h>
#include <isobrick/progress.h>
#include <isobrick/volume_source.h>
#include "bricks/store_writer.h"
#include "pipeline/convert/brick_output.h"
#include "pipeline/convert/convert_journal.h"
#include "pipeline/convert/sparse_bricks.h"
#include "pipeline/convert/sparse_ranges.h"
#include "pipeline/index/value_counts.h"

namespace isobrick::inline v0 {

/// Converts a source that knows where it is the fill value: only the bricks that
/// may be something else are read, encoded and downsampled, so that time and memory
/// follow what is there and not the extent. The store is the one that a Cascade
/// writes, but for the order of bricks within a shard.
///
/// A level is worked through by the bricks of the next one: the up to eight
/// bricks that become one go through memory together, and the next
/// level's bricks wait in a temporary file.
class SparsePyramid {
 public:
  struct Counts : BrickCounts {
    bool has_nan = false;
  };

  /// Whether a source and a layout can be converted in this way.
  static bool possible(const VolumeSource& source, const StoreLayout& layout);

  /// Looks for the bricks that are there. Throws UsageError for a budget that is too small, naming
  /// one that does, which is `index_memory` at least.
  SparsePyramid(VolumeSource& source, const StoreLayout& layout, const ConvertOptions& options,
                int threads, std::uint64_t index_memory = 0);

  int threads() const { return threads_; }

  /// `histogram` sees every sample of level 0.
  Counts write(StoreWriter& store, ConvertJournal& journal, ValueCounts& histogram,
               const std::filesystem::path& folder, bool resumed, Progress& progress);

 private:
  class Level;

  /// Chooses threads and bricks in flight that leave room for `fixed` bytes; false where none do.
  bool fit(std::size_t fixed, std::uint64_t memory);

  VolumeSource& source_;
  const StoreLayout& layout_;
  int threads_;
  std::size_t in_flight_;
  SparseBricks bricks_;  ///< of level 0, until they are written
};

}  // namespace isobrick

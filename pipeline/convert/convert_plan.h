#pragma once

#include <cstddef>
#include <cstdint>

#include <isobrick/convert.h>
#include <isobrick/volume_source.h>
#include "bricks/store_writer.h"

namespace isobrick::inline v0 {

/// What the store of `volume` will look like, with zstd where the codec is still to be chosen;
/// `sparse`: its bricks must suit SparsePyramid. Throws
/// UsageError for options that make no sense.
StoreLayout plan_layout(const VolumeInfo& volume, const ConvertOptions& options,
                        bool sparse = false);

/// How a conversion keeps to its budget.
///
/// A level is worked through in slabs: as many planes as a brick has, or twice
/// as many when that is odd, so that a slab's planes pair up for the next level.
/// While slabs of a level and of all coarser ones fit together, each sample
/// passes through memory once (a cascade). Otherwise the level goes through in
/// smaller pieces and the next one through a temporary file.
class ConvertPlan {
 public:
  /// `source_bytes`: what the source takes for itself. Throws UsageError when not even one piece
  /// fits, naming the least budget, which is `index_memory` at least.
  ConvertPlan(const StoreLayout& layout, std::uint64_t memory, int threads, bool random_access,
              std::size_t source_bytes, std::uint64_t index_memory = 0);

  /// As many as requested, or fewer where the budget is small for the bricks.
  int threads() const { return threads_; }
  /// Bricks being encoded or waiting for their turn to be written.
  int bricks_in_flight() const { return bricks_in_flight_; }

  Index slab_planes() const { return slab_planes_; }
  /// Whether slabs of `level` and of all coarser levels fit together.
  bool cascade_fits(int level) const { return cascade_bytes(level) <= room_; }
  /// Whether a second slab of level 0 fits beside the cascade, to be filled meanwhile.
  bool second_slab_fits() const;
  /// The box of samples to read at a time where a cascade does not fit.
  Int3 piece(int level) const;
  /// Planes of a stream to copy at a time when it is spooled.
  Index spool_planes() const;

 private:
  std::size_t encoding_bytes() const;
  std::size_t slab_bytes(int level) const;
  Int3 min_piece() const;
  std::size_t cascade_bytes(int level) const;
  std::size_t ranges_bytes(int level) const;
  std::size_t min_room(bool random_access) const;
  /// The least samples of any level that become one of the next.
  std::size_t coarser_part() const;

  const StoreLayout& layout_;
  std::size_t source_bytes_;
  int threads_, bricks_in_flight_;
  Index slab_planes_;
  std::size_t room_ = 0;  ///< what the program itself and the encoders leave
};

}  // namespace isobrick

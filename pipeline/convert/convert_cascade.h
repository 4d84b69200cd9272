#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <isobrick/volume_source.h>
#include "pipeline/convert/convert_level.h"
#include "pipeline/convert/convert_plan.h"

namespace isobrick::inline v0 {

/// Reads `box` into `out`: with several threads where the source allows it.
void read_box(VolumeSource& source, Box3 box, std::byte* out);

/// Takes a level and all coarser ones through memory together: a full slab is
/// written and downsampled into the slab of the next level, which when it is full
/// goes the same way. Each sample is read once and every level written at once.
class Cascade {
 public:
  /// `levels` are the writers from the level of `source` up to the coarsest.
  Cascade(const ConvertPlan& plan, const StoreLayout& layout, int first_level,
          std::vector<LevelWriter*> levels);

  void run(VolumeSource& source);

 private:
  struct Stage {
    Lattice lattice;
    LevelWriter* writer;
    Int3 factors;  ///< to the next stage, if there is one
    std::unique_ptr<std::byte[]> slab;
    Index z0 = 0, planes = 0, capacity;  ///< the slab holds planes [z0, z0 + planes)

    std::size_t plane_bytes() const {
      return static_cast<std::size_t>(lattice.extent.x * lattice.extent.y) * lattice.sample_bytes();
    }
    std::byte* free_planes() const {
      return slab.get() + plane_bytes() * static_cast<std::size_t>(planes);
    }
    std::size_t slab_bytes() const { return plane_bytes() * static_cast<std::size_t>(capacity); }
    Box3 box() const { return {{0, 0, z0}, {lattice.extent.x, lattice.extent.y, z0 + planes}}; }
  };

  void flush(std::size_t stage);

  Downsampling method_;
  std::vector<Stage> stages_;
  bool second_slab_;
};

}  // namespace isobrick

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <isobrick/volume_source.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// An OpenVDB level set of a surface: near it distances from its triangles, negative
/// inside, and elsewhere the largest of them. First come all triangles, in any
/// pieces and order, which never shows in the result; then the inside follows.
class VdbLevelSet {
 public:
  virtual ~VdbLevelSet() = default;

  /// Triangles in world space, which name their corners among `positions`. Throws
  /// UsageError when the grid outgrows its budget, as the others do.
  virtual void add(std::span<const Vec3f> positions,
                   std::span<const std::array<std::uint32_t, 3>> triangles) = 0;

  /// Which samples of `box` are inside: one byte each, C order [z, y, x], not 0 for
  /// inside; or all of them. Boxes do not overlap; what is in none is outside.
  virtual void put_inside(Box3 box, const std::uint8_t* inside) = 0;
  virtual void put_all_inside(Box3 box) = 0;

  /// Writes the grid as all of `file`, to be published. Throws Error when that fails.
  virtual void write(OutputFile& file) = 0;
};

/// A float grid named `name` of the class "level set" over the volume. Its band is
/// `half_band` of the largest spacing wide on either side. `threads` 0: all cores. With
/// what it keeps of the triangles of one add() it may take `budget` bytes.
std::unique_ptr<VdbLevelSet> make_vdb_level_set(const VolumeInfo& info, const std::string& name,
                                                int half_band, int threads, std::uint64_t budget);

/// The same where OpenVDB was missing when this was built: throws UsageError.
std::unique_ptr<VdbLevelSet> make_vdb_level_set_if_built(const VolumeInfo& info,
                                                         const std::string& name, int half_band,
                                                         int threads, std::uint64_t budget);

}  // namespace isobrick

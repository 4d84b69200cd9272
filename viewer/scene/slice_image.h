#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// A request for a plane of samples.
struct SliceRequest {
  int axis = 2;                                   ///< normal of the plane: 0 x, 1 y, 2 z
  double position = 0;                            ///< along it, in samples of level 0
  int stored = 0;                                 ///< finest stored level to use
  std::uint64_t bytes = std::uint64_t{64} << 20;  ///< maximum bytes of the image

  friend bool operator==(const SliceRequest&, const SliceRequest&) = default;
};

/// The plane of samples nearest to the requested position, of the finest level that is allowed and
/// fits.
struct SliceSamples {
  SliceRequest request;
  int stored = 0;
  /// u8 and u16 as stored; other types as f32.
  ScalarType type = ScalarType::u8;
  /// Extent along the other two axes, in the order x, y, z; the first is the fastest.
  Index width = 0, height = 0;
  std::vector<std::byte> pixels;
  /// World space: the outer corner of the first pixel and the image's edges. The image extends half
  /// a sample beyond the outer samples, so that a texture's pixel centres lie on samples.
  Vec3d corner, along_width, along_height;
  std::string damage;  ///< message about damaged bricks, whose pixels have the fill value
};

/// Reads a slice through resident bricks. Throws OperationCancelled, and UsageError for an axis or
/// level out of range. Damaged bricks do not throw.
SliceSamples read_slice(ResidentBricks& bricks, const SliceRequest& request,
                        const CancellationToken& token);

}  // namespace isobrick

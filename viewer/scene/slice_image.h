#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stream/resident_bricks.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

/// A plane of samples that is wanted.
struct SliceRequest {
  int axis = 2;                                   ///< normal of the plane: 0 x, 1 y, 2 z
  double position = 0;                            ///< along it, in samples of level 0
  int stored = 0;                                 ///< the finest stored level that will do
  std::uint64_t bytes = std::uint64_t{64} << 20;  ///< most that the image may take

  friend bool operator==(const SliceRequest&, const SliceRequest&) = default;
};

/// Samples of the plane nearest to a position, of the finest level that is allowed
/// and fits.
struct SliceSamples {
  SliceRequest request;
  int stored = 0;
  /// u8 and u16 as they are stored; all others as f32.
  ScalarType type = ScalarType::u8;
  /// Pixels along the two axes left in the order x, y, z. The first is the fastest.
  Index width = 0, height = 0;
  std::vector<std::byte> pixels;
  /// World space: the outer corner of the first pixel, and the image's edges, so that a
  /// texture lies where its samples do. Pixels reach half a sample beyond them.
  Vec3d corner, along_width, along_height;
  std::string damage;  ///< of bricks that could not be read: their pixels are the fill value
};

/// Reads it through resident bricks. Throws OperationCancelled, and UsageError for an axis
/// or level that there is not; a damaged brick does not stop it.
SliceSamples read_slice(ResidentBricks& bricks, const SliceRequest& request,
                        const CancellationToken& token);

}  // namespace isobrick

#pragma once

#include <array>
#include <cstddef>
#include <string>

#include <isobrick/transform.h>
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {

/// OME-Zarr's coordinate transformations of the axes of space: world = matrix · index + offset.
/// Axes before z, y, x are left out; a transformation that mixes them with space is refused.
struct AffineMap {
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row-major, x first
  Vec3d offset;
};

/// What `first` and then `second` do.
AffineMap then(const AffineMap& first, const AffineMap& second);

/// One transformation of OME-Zarr 0.6 over so many axes: identity, scale, translation,
/// rotation, affine or a sequence of them.
AffineMap parse_transformation(const JsonReader& json, std::size_t axes);

/// The list of OME-Zarr 0.4 and 0.5: a scale, and after it perhaps a translation.
AffineMap parse_scale_and_translation(const JsonReader& list, std::size_t axes);

/// The map as a transform, without a unit. `json` names it in the messages for what is not
/// finite, or no transform: one that shears.
Transform to_transform(const JsonReader& json, const AffineMap& map);

/// The name of the coordinate system that a transformation's "input" or "output" is.
std::string coordinate_system(const JsonReader& reference);

/// Whether the columns have length 1 and are at right angles, within 1e-4.
/// Mirrored ones are as good.
bool is_orthonormal(const std::array<double, 9>& direction);

}  // namespace isobrick

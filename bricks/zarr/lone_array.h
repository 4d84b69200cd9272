#pragma once

#include <string>
#include <string_view>

#include "bricks/zarr/array_metadata.h"

// Zarr arrays that other programs have written: what their metadata leave to a reader to find out.
// `where` names the file.

namespace isobrick::inline v0 {

/// The zarr.json of a group whose multiscale image has this array as its only level, at ".".
/// Throws Error for an array with less than three dimensions.
std::string group_of(const ArrayMetadata& array, const std::string& where);

/// The zarr.json `array` with the names that xarray and others give its dimensions in `attributes`,
/// the text of its .zattrs.
std::string with_dimension_names(std::string_view array, std::string_view attributes,
                                 const std::string& where);

/// Throws Error when the dimensions are x, y and z in another order: taken for z, y, x they would
/// make a mirrored volume.
void check_axis_order(const ArrayMetadata& array, const std::string& where);

}  // namespace isobrick

#pragma once

#include <string>
#include <string_view>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/array_metadata.h"

namespace isobrick::inline v0 {

// Zarr version 2, translated to version 3, so that one parser reads
// both. `where` names the file; DamageError for what is no valid Zarr, Error
// for what is not supported, naming it.

/// The zarr.json that means what a .zarray means.
std::string v3_from_zarray(std::string_view text, const std::string& where);

/// The zarr.json that means what the .zattrs of an OME-NGFF 0.4 image means;
/// empty when it is no image.
std::string v3_from_zattrs(std::string_view text, const std::string& where);

// And ours, translated to version 2.

/// The .zarray of an array without shards whose samples are one of our types.
std::string to_zarray(const ArrayMetadata& array);

/// The .zattrs of an OME-NGFF 0.4 image; what is ours stands under `isobrick`.
std::string to_zattrs(const ImageMetadata& image);

/// The .zgroup of any group.
std::string zgroup_json();

}  // namespace isobrick

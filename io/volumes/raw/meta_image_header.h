#pragma once

#include <string>

#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {

/// Parses a MetaImage header (`.mhd`, or the beginning of a `.mha`) and selects
/// one volume where there are several.
TextHeader parse_meta_image_header(const std::string& path, const Selection& selection);

}  // namespace isobrick

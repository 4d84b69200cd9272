#pragma once

#include <string>

#include "isobrick/io/detached_header.h"

namespace isobrick {

/// Parses a MetaImage header (`.mhd`) whose samples lie, uncompressed, in one
/// file of their own.
DetachedHeader parse_meta_image_header(const std::string& path);

}  // namespace isobrick

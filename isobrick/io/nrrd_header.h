#pragma once

#include <string>

#include "isobrick/io/detached_header.h"

namespace isobrick {

/// Parses a NRRD header (NRRD0001 … NRRD0005) whose samples lie, uncompressed,
/// in one file of their own. Comments and key/value pairs are skipped.
DetachedHeader parse_nrrd_header(const std::string& path);

}  // namespace isobrick

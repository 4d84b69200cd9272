#pragma once

#include <string>

#include "isobrick/volumes/text_header.h"

namespace isobrick {

/// Parses a NRRD header (NRRD0001 … NRRD0005), attached to its samples or not,
/// and selects one volume where there are several. Comments and key/value pairs
/// are skipped.
TextHeader parse_nrrd_header(const std::string& path, const Selection& selection);

}  // namespace isobrick

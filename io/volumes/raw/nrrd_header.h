#pragma once

#include <string>

#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {

/// Keys by which nrrd_header_text() keeps what a NRRD has no fields for.
inline constexpr const char* kNrrdGridClass = "isobrick grid class";
inline constexpr const char* kNrrdGridName = "isobrick grid name";
inline constexpr const char* kNrrdFillValue = "isobrick fill value";

/// Parses a NRRD header (NRRD0001 … NRRD0005), attached to its samples or not,
/// and selects one volume where there are several. Comments and key/value pairs
/// are skipped.
TextHeader parse_nrrd_header(const std::string& path, const Selection& selection);

}  // namespace isobrick

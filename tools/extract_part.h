#pragma once

#include "tools/extract_plan.h"

namespace isobrick::tools {

/// The extension of pieces of meshes.
inline constexpr std::string_view kPieceExtension = ".piece";

/// `isobrick extract --part`: a piece of each isosurface.
int run_extract_part(const ExtractArguments& given, Console& console);

}  // namespace isobrick::tools

#pragma once

#include "tools/extract_plan.h"

namespace isobrick::tools {

/// The extension of pieces of meshes.
inline constexpr std::string_view kPieceExtension = ".piece";

/// `isobrick extract --part`: a piece of each isosurface.
int run_extract_part(const ExtractArguments& given, Console& console);

/// `isobrick extract --resume`: makes each mesh by way of pieces in a folder beside it. The folder
/// goes once the mesh is there.
CommandOutput make_resumable(const ExtractArguments& arguments,
                             const std::vector<ExtractedSurface>& surfaces,
                             const StoreReader& store, Console& console);

}  // namespace isobrick::tools

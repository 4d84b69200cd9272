#pragma once

#include "ranks/ranks.h"
#include "tools/extract_plan.h"

namespace isobrick::tools {

/// The extension of pieces of meshes.
inline constexpr std::string_view kPieceExtension = ".piece";

/// `isobrick extract --part`: a piece of each isosurface.
int run_extract_part(const ExtractArguments& given, Console& console);

/// Makes each mesh by way of pieces in a folder beside it, which goes once the mesh is there: for
/// --resume, and for the ranks of a job, where `job` is not null. The pieces that are there are
/// kept.
CommandOutput make_by_pieces(const ExtractArguments& arguments,
                             const std::vector<ExtractedSurface>& surfaces,
                             const StoreReader& store, Ranks* job, Console& console);

}  // namespace isobrick::tools

#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include "ranks/piece_places.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Collective: puts the pieces of a mesh together to the PLY that PlySink makes, byte for byte.
/// Every rank writes its own pieces at their places, and forgets each once it is written. The file
/// has its name once all have. Throws as find_places(), OutputFile and PieceReader do. Returns the
/// mesh's size.
MeshSize write_ply(Ranks& ranks, const PartPlans& parts, std::vector<OwnPiece> pieces,
                   const MeshHeader& header, const std::filesystem::path& path, bool force,
                   Progress& progress);

}  // namespace isobrick

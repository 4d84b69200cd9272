#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include "io/meshes/parted_mesh_sink.h"
#include "pipeline/pieces/merge_limit.h"
#include "ranks/piece_places.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Where a PVTP is cut, and from how many vertices on it has numbers of 64 bits. Tests have smaller
/// ones.
struct PvtpLimits {
  std::uint64_t part_triangles = PartedMeshSink::kPartTriangles;
  std::uint64_t max_narrow_vertices = kMaxNarrowVertices;
};

/// Collective: puts the pieces of a mesh together to the PVTP that PvtpSink makes, byte for byte.
/// Ranks write their pieces into two scratch files beside it, and then the parts, each on one rank.
/// Pieces are forgotten once they are written. The file has its name once all is there. Throws as
/// find_places(), PartedOutput and PieceReader do. Returns the mesh's size.
MeshSize write_pvtp(Ranks& ranks, const PartPlans& parts, std::vector<OwnPiece> pieces,
                    MeshHeader header, const std::filesystem::path& path, bool force,
                    Progress& progress, const PvtpLimits& limits = {});

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/mesh.h>
#include "pipeline/pieces/neighbour_numbers.h"
#include "pipeline/pieces/part_plan.h"
#include "pipeline/pieces/piece_bytes.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// A piece that this rank made.
struct OwnPiece {
  std::uint32_t number = 0;  ///< of its part
  std::shared_ptr<PieceBytes> bytes;
};

/// Where a piece goes in the mesh.
struct PiecePlace {
  MeshSize before;           ///< of all pieces before it
  NeighbourNumbers numbers;  ///< of the vertices of other pieces that it names
};

/// Where the pieces of a mesh go.
struct PiecePlaces {
  MeshSize mesh;                ///< of all pieces
  std::vector<PiecePlace> own;  ///< one for each own piece
};

/// Collective: finds the places of pieces that the ranks have made, each part on one of them. Ranks
/// learn the size of every piece. Of vertices they ask only for those that their pieces name, and
/// only the rank that made the piece these belong to, so that what a rank gets grows with the
/// boundary of its pieces. Throws DamageError where pieces do not fit each other.
PiecePlaces find_places(Ranks& ranks, const PartPlans& parts, std::span<const OwnPiece> pieces);

}  // namespace isobrick

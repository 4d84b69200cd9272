#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "io/meshes/levels/level_writer.h"

namespace isobrick::inline v0 {

/// How the contents of tiles hold meshes.
struct TileForm {
  bool normals = false;
  std::string unit = {};  ///< of the mesh, as unit_name() has it; empty: taken for metres
  std::optional<std::array<std::uint8_t, 4>> colour = {};  ///< sRGB; alpha is not used
  bool compress = false;  ///< without loss (EXT_meshopt_compression)
};

/// A coordinate of a fragment's point as contents have it: in the unit of the mesh, from the origin
/// of the grid. Neighbours have the same float for the same point of a level's lattice.
float tile_coordinate(const FragmentPlace& place, std::size_t axis, std::uint16_t step);

/// A binary glTF of a fragment's mesh, for a tile of 3D Tiles whose frame has z up, metres and its
/// origin at that of the grid. Empty without triangles. Thread-safe. Throws as check_meshopt()
/// where it is to be compressed.
std::string tile_glb(const FragmentMesh& mesh, const FragmentPlace& place, const TileForm& form);

}  // namespace isobrick

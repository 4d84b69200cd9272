#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <isobrick/mesh.h>

// What lies in a folder of 3D Tiles, read by the specifications of 3D Tiles 1.1 and glTF 2.0.

namespace isobrick::test {

/// A matrix of a transform, column after column.
using Matrix = std::array<double, 16>;

struct DecodedTile {
  MeshBounds box;  ///< of the world, metres
  double error = 0;
  int depth = 0;                 ///< 0: the root
  int level = -1;                ///< of its content; -1: none
  std::size_t parent = 0;        ///< among all tiles; the root's is itself
  std::vector<Vec3f> stored;     ///< positions as the file has them
  std::vector<Vec3d> positions;  ///< of the world, metres
  std::vector<Vec3f> normals;    ///< of the world
  std::vector<Triangle> triangles;
  nlohmann::json gltf;
};

struct DecodedTileset {
  double error = 0;
  std::vector<DecodedTile> tiles;  ///< parents first
  std::set<std::string> files;     ///< that it names, itself included, within the folder
  std::set<std::string> tilesets;  ///< those of the files that are tilesets

  std::vector<const DecodedTile*> of_level(int level) const;
  int levels() const;
};

/// Reads a tileset with all that it names. Fails the test for whatever the specification does not
/// permit: members and their types, errors that grow from parent to child, boxes that leave their
/// parent's, content that leaves its box, names of files that are not there and files without a
/// name.
DecodedTileset decode_tiles(const std::filesystem::path& folder,
                            const std::set<std::string>& other_files = {});

}  // namespace isobrick::test

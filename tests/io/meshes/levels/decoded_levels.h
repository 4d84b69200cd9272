#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/meshes/levels/chunk_lattice.h"

// What lies in a folder of neuroglancer's format, read by the specification and by Draco.

namespace isobrick::test {

struct DecodedFragment {
  GridCell cell;
  std::vector<LatticePoint> points;  ///< on the lattice of the level, not of the fragment
  std::vector<Triangle> triangles;
};

struct DecodedLevel {
  float scale = 0;
  std::vector<DecodedFragment> fragments;  ///< empty ones, too

  std::uint64_t triangles() const;
  std::vector<LatticeTriangle> lattice_triangles() const;
};

struct DecodedMesh {
  std::array<float, 3> edges{}, origin{};
  std::vector<DecodedLevel> levels;

  /// The length of a step on a level's lattice.
  double step(std::size_t level) const;
  Vec3d position(std::size_t level, const LatticePoint& point) const;
};

std::string read_text(const std::filesystem::path& path);

/// Of a manifest and the fragments that it describes. Fails the test where sizes are wrong.
DecodedMesh decode_mesh(const std::string& manifest, const std::string& fragments);
/// The same of a segment of a folder without shards.
DecodedMesh decode_segment(const std::filesystem::path& folder, std::uint64_t id = 1);

}  // namespace isobrick::test

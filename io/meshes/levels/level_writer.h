#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/meshes/levels/chunk_lattice.h"
#include "io/meshes/levels/fragment_mesh.h"

namespace isobrick::inline v0 {

/// A fragment of a level that has triangles.
struct EncodedFragment {
  std::uint64_t key = 0;    ///< z_order_key of its place
  std::uint32_t bytes = 0;  ///< of its mesh as the format has it
  /// Bit x + 2y + 4z: the half of each axis has triangles. Without halves bit 0.
  std::uint8_t halves = 0;
  FragmentPoint lo{}, hi{};  ///< the smallest and the largest coordinates
};

/// A level of a mesh whose fragments are encoded.
struct EncodedLevel {
  /// The edge of an equilateral triangle of its mean area, in world units.
  double edge = 0;
  /// How far the surface of level 0 is at most from this one, in world units:
  /// SimplifyStage::error() of all levels up to it. Of formats with LevelNeeds::errors.
  double error = 0;
  std::vector<EncodedFragment> fragments;  ///< in the order of their keys
};

/// What a format wants of levels.
struct LevelNeeds {
  bool normals = false;  ///< at the vertices, where the mesh has them
  bool halves = false;   ///< fragments above level 0 are also cut through their middles
  bool errors = false;   ///< EncodedLevel::error
};

/// A fragment among those of its mesh.
struct FragmentPlace {
  const ChunkGrid& grid;
  int level = 0;
  GridCell cell{};
};

/// What a format makes of the levels of one mesh: DetailSink calls it.
class LevelWriter {
 public:
  virtual ~LevelWriter() = default;

  virtual LevelNeeds needs() const = 0;
  /// Before the first fragment.
  virtual void begin(const MeshHeader& header) = 0;
  /// A fragment's mesh as the format has it; empty without triangles. Called by several threads at
  /// once.
  virtual std::string encode(const FragmentMesh& mesh, const FragmentPlace& place) const = 0;
  /// Takes the next fragment: level by level, and in the order of their keys.
  virtual void write(const FragmentPlace& place, std::string_view bytes) = 0;
  /// All fragments were written, from the finest level to the coarsest; without levels for a mesh
  /// without triangles.
  virtual void finish(const ChunkGrid& grid, std::vector<EncodedLevel> levels) = 0;
  /// Bytes written so far.
  virtual std::uint64_t bytes() const = 0;
};

}  // namespace isobrick

#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/meshes/levels/level_writer.h"

namespace isobrick::inline v0 {

/// A box along the axes that is never less than what it was made of, whatever the rounding.
class TileBox {
 public:
  TileBox() = default;
  /// No side is shorter than `thickness`: viewers cannot use boxes without volume.
  TileBox(const MeshBounds& bounds, double thickness);

  MeshBounds bounds() const { return {centre_ - half_, centre_ + half_}; }
  double diagonal() const;
  /// As a tileset has it: the centre and three half axes.
  nlohmann::ordered_json json() const;

 private:
  Vec3d centre_, half_;
};

/// The smallest bounds with both.
MeshBounds united(const MeshBounds& a, const MeshBounds& b);

/// The text of a tileset, 3D Tiles 1.1.
std::string tileset_text(double error, nlohmann::ordered_json root);

/// What a tile is beside its children.
nlohmann::ordered_json tile_json(const TileBox& box, double error);

/// The tiles of a mesh: an octree whose cells are the fragments of all levels. Cells above the
/// coarsest level have no content. Lengths are in metres, from the origin of the grid.
class TileTree {
 public:
  TileTree(const ChunkGrid& grid, const std::vector<EncodedLevel>& levels, double metres);

  /// The box of all of it.
  const TileBox& box() const { return root_; }
  /// What is missing where nothing of it is shown.
  double error() const { return error_; }

  /// The file of a fragment's content, within the folder.
  static std::string content_name(int level, const GridCell& cell);
  /// Writes tileset.json, of a large tree others as well. Returns their bytes.
  std::uint64_t write(const std::filesystem::path& folder) const;

 private:
  struct Node {
    std::uint64_t key = 0;  ///< z_order_key of its cell
    TileBox box;
    bool has_content = false;
  };
  struct Writing;

  TileBox content_box(const FragmentPlace& place, const EncodedFragment& fragment) const;
  /// The cells of a level: those with content and those that have children.
  void add_level(const std::vector<EncodedFragment>& fragments, const ChunkGrid& grid);
  double error_of(std::size_t level, const Node& node) const;
  bool begins_file(std::size_t level) const;
  nlohmann::ordered_json tile_of(Writing& writing, std::size_t level, const Node& node,
                                 bool is_root) const;

  double metres_, thickness_, error_ = 0;
  std::vector<double> errors_;            ///< of levels with content
  std::vector<std::vector<Node>> nodes_;  ///< of each level, in the order of their keys
  std::size_t count_ = 0;
  Vec3d origin_;
  TileBox root_;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "io/meshes/levels/level_folder.h"
#include "io/meshes/levels/tile_tree.h"

namespace isobrick::inline v0 {

/// The files of meshes as 3D Tiles 1.1: tileset.json, and a binary glTF for each fragment of each
/// level. Meshes of labels have a folder each, with a tileset that the folder's own one refers to.
class TilesFolder final : public LevelFolder {
 public:
  /// Throws as check_meshopt() where contents are to be compressed.
  TilesFolder(std::filesystem::path folder, bool has_labels, bool compress);

  std::unique_ptr<LevelSink> add_mesh(const Label& label, const LevelOptions& options,
                                      const MeshProperties& properties) override;
  std::string file_of(const Label& label) const override;
  void finish() override;
  std::uint64_t bytes() const override;

  /// Whether a file of this name, within the folder, belongs to such an output.
  static bool is_own_name(std::string_view name);

 private:
  class Tileset;
  /// The tileset of a mesh, seen from the one of the folder.
  struct Entry {
    TileBox box;
    double error = 0;
  };

  std::filesystem::path folder_of(const Label& label) const;
  void add_entry(const Label& label, const Entry& entry, std::uint64_t bytes);

  std::filesystem::path folder_;
  bool has_labels_, compress_;
  mutable std::mutex mutex_;
  std::map<Label, Entry> entries_;
  std::uint64_t bytes_ = 0;
};

}  // namespace isobrick

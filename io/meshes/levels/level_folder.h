#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <isobrick/label.h>
#include "io/meshes/levels/detail_sink.h"

namespace isobrick::inline v0 {

/// What viewers may show of a mesh beside its surface.
struct MeshProperties {
  std::string name = {};                                   ///< empty: none
  std::optional<std::array<std::uint8_t, 4>> colour = {};  ///< sRGB and alpha
};

/// The files of meshes with levels of detail, in a folder that is there. Its functions may be
/// called by several threads at once, but finish().
class LevelFolder {
 public:
  virtual ~LevelFolder() = default;

  /// A sink for the mesh of a label, which has its place when it is finished. Throws UsageError for
  /// labels that the format cannot name.
  virtual std::unique_ptr<LevelSink> add_mesh(const Label& label, const LevelOptions& options,
                                              const MeshProperties& properties) = 0;
  /// The file of a label's mesh, within the folder; empty where it shares its files with others.
  virtual std::string file_of(const Label& label) const = 0;
  /// Writes what describes the meshes. Nothing follows.
  virtual void finish() = 0;
  /// Bytes written so far; those of the output when it is finished.
  virtual std::uint64_t bytes() const = 0;
};

/// How a folder of levels is written.
struct LevelFolderOptions {
  bool as_tiles = false;    ///< 3D Tiles, rather than neuroglancer's format
  bool compress = false;    ///< 3D Tiles only: EXT_meshopt_compression
  bool sharded = false;     ///< neuroglancer's format only
  bool has_labels = false;  ///< a mesh for each, rather than the only one
};

/// Throws UsageError where the format needs a library that is not there.
std::unique_ptr<LevelFolder> open_level_folder(const std::filesystem::path& folder,
                                               const LevelFolderOptions& options);

/// Opens a folder with a single mesh. See FolderOutput for what it throws.
std::unique_ptr<MeshSink> create_level_mesh(const std::filesystem::path& path, bool force,
                                            const LevelFolderOptions& folder,
                                            const LevelOptions& options);

/// Whether a file of this name, within the folder, belongs to such an output of any format.
bool is_level_file(std::string_view name);

}  // namespace isobrick

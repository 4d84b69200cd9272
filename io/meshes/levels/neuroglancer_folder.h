#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/mesh.h>
#include "io/meshes/levels/segment_sink.h"
#include "io/meshes/levels/shard_files.h"

namespace isobrick::inline v0 {

/// What neuroglancer shows of a segment beside its mesh.
struct SegmentProperties {
  std::string name = {};                                   ///< empty: none
  std::optional<std::array<std::uint8_t, 4>> colour = {};  ///< sRGB and alpha
};

/// The files of meshes with levels of detail for neuroglancer (neuroglancer_multilod_draco), in a
/// folder that is there: two files a segment, or shards with all of them. Its functions may be
/// called by several threads at once, but finish().
class NeuroglancerFolder {
 public:
  /// Throws UsageError where this isobrick was built without Draco.
  NeuroglancerFolder(std::filesystem::path folder, bool sharded);

  /// A sink for the mesh of a segment, which has its place when it is finished.
  std::unique_ptr<LevelSink> segment(std::uint64_t id, const LevelOptions& options,
                                     const SegmentProperties& properties);
  /// Writes what describes the segments. Nothing follows.
  void finish();
  /// Bytes written so far, to scratch files as well; those of the output when it is finished.
  std::uint64_t bytes() const;

  /// Whether a file of this name, within the folder, belongs to such an output.
  static bool is_own_name(std::string_view name);

 private:
  class Segment;

  void keep_unit(const std::string& unit);
  void add_bytes(std::uint64_t bytes);
  void add_shard_entry(std::uint64_t id, FileWriter& fragments, const std::string& manifest);
  void write_info(std::optional<ShardBits> bits);
  void write_properties();

  std::filesystem::path folder_;
  bool sharded_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, SegmentProperties> properties_;
  std::string unit_;
  std::uint64_t bytes_ = 0;
  FileWriter collected_;  ///< of segments that wait for their shards
  std::map<std::uint64_t, ShardEntry> entries_;
};

/// Opens a folder with a mesh as its only segment. See FolderOutput for what it throws.
std::unique_ptr<MeshSink> create_neuroglancer_mesh(const std::filesystem::path& path, bool force,
                                                   bool sharded, const LevelOptions& options);

}  // namespace isobrick

#pragma once

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
#include "io/meshes/levels/level_folder.h"
#include "io/meshes/levels/shard_files.h"

namespace isobrick::inline v0 {

/// The files of meshes with levels of detail for neuroglancer (neuroglancer_multilod_draco): two
/// files a segment, or shards with all of them. Labels are the numbers of segments.
class NeuroglancerFolder final : public LevelFolder {
 public:
  /// Throws UsageError where this isobrick was built without Draco.
  NeuroglancerFolder(std::filesystem::path folder, bool sharded);

  std::unique_ptr<LevelSink> add_mesh(const Label& label, const LevelOptions& options,
                                      const MeshProperties& properties) override;
  std::string file_of(const Label& label) const override;
  void finish() override;
  std::uint64_t bytes() const override;

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
  std::map<std::uint64_t, MeshProperties> properties_;
  std::string unit_;
  std::uint64_t bytes_ = 0;
  FileWriter collected_;  ///< of segments that wait for their shards
  std::map<std::uint64_t, ShardEntry> entries_;
};

}  // namespace isobrick

#include "io/meshes/levels/level_folder.h"

#include "io/bytes/folder_output.h"
#include "io/meshes/levels/neuroglancer_folder.h"
#include "io/meshes/levels/tiles_folder.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// What names the mesh of a folder that has no others.
constexpr Label kOnlyMesh = 1;

/// A folder with one mesh.
class LevelMesh final : public LevelSink {
 public:
  LevelMesh(const fs::path& path, bool force, const LevelFolderOptions& folder,
            const LevelOptions& options)
      : output_(path, force, is_level_file),
        folder_(open_level_folder(output_.folder(), folder)),
        mesh_(folder_->add_mesh(kOnlyMesh, options, {.name = output_.path().stem().string()})) {}

  Indexing indexing() const override { return mesh_->indexing(); }
  bool takes_wide() const override { return mesh_->takes_wide(); }
  void begin(const MeshHeader& header) override { mesh_->begin(header); }
  void write(const MeshChunk& chunk) override { mesh_->write(chunk); }
  void finish() override {
    mesh_->finish();
    folder_->finish();
    is_finished_ = true;
    output_.publish();
  }
  std::uint64_t bytes() const override { return is_finished_ ? folder_->bytes() : mesh_->bytes(); }
  std::uint64_t memory() const override { return mesh_->memory(); }
  std::vector<WrittenLevel> levels() const override { return mesh_->levels(); }

 private:
  FolderOutput output_;
  std::unique_ptr<LevelFolder> folder_;
  std::unique_ptr<LevelSink> mesh_;
  bool is_finished_ = false;
};

}  // namespace

std::unique_ptr<LevelFolder> open_level_folder(const fs::path& folder,
                                               const LevelFolderOptions& options) {
  if (options.as_tiles)
    return std::make_unique<TilesFolder>(folder, options.has_labels, options.compress);
  return std::make_unique<NeuroglancerFolder>(folder, options.sharded);
}

std::unique_ptr<MeshSink> create_level_mesh(const fs::path& path, bool force,
                                            const LevelFolderOptions& folder,
                                            const LevelOptions& options) {
  return std::make_unique<LevelMesh>(path, force, folder, options);
}

bool is_level_file(std::string_view name) {
  return NeuroglancerFolder::is_own_name(name) || TilesFolder::is_own_name(name);
}

}  // namespace isobrick

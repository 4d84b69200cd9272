#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include "filters/mesh_spool.h"
#include "io/bytes/output_file.h"
#include "io/meshes/levels/level_sink.h"
#include "io/meshes/levels/manifest.h"

namespace isobrick::inline v0 {

/// How a mesh is divided into levels of detail.
struct LevelOptions {
  int levels = 0;   ///< 0: as many as it takes until one fragment has the whole mesh
  int threads = 0;  ///< 0: all cores; never shows in the bytes
  std::uint64_t memory = std::uint64_t{16} << 20;  ///< level_memory() takes more
  std::filesystem::path scratch_beside = "-";
  /// Hears of levels, within another stage. It must outlive the sink. Null: nobody.
  Progress* progress = nullptr;
};

/// What writing a mesh with levels holds at most, LevelOptions::memory included.
std::uint64_t level_memory(const LevelOptions& options);
/// Of a budget of the whole operation, what becomes LevelOptions::memory.
std::uint64_t level_share(std::uint64_t budget);

/// Makes levels of detail of a mesh and encodes them for neuroglancer. Level 0 is the mesh itself;
/// each further one is the one before with a quarter of its triangles, simplified with its topology
/// kept. Levels end early where a further one would not be clearly smaller.
///
/// What it writes depends on the mesh and the number of levels alone.
class SegmentSink final : public LevelSink {
 public:
  /// Takes the manifest when all fragments are written.
  using Finish = std::function<void(const std::string& manifest)>;

  /// Appends the fragments to `fragments`, which must outlive it.
  SegmentSink(FileWriter& fragments, const LevelOptions& options, Finish finish);

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override { return level_memory(options_); }

  std::vector<WrittenLevel> levels() const override { return written_; }

 private:
  /// What a mesh measures, as far as its grid depends on it.
  struct Extent {
    MeshBounds bounds;
    double edge = 0;  ///< of an equilateral triangle of the mean area
  };

  MeshSpool make_spool() const;
  Extent measure(MeshSpool& mesh) const;
  void choose_grid(const Extent& extent);
  void write_level(MeshSpool& mesh, int level, double scale);
  /// Replaces the mesh by a simpler one; false where there is none worth a level.
  bool simplify();

  FileWriter& fragments_;
  LevelOptions options_;
  Finish finish_;
  ScratchPlace place_;
  MeshSpool mesh_;
  ChunkGrid grid_;
  std::vector<ManifestLevel> manifest_;
  std::vector<WrittenLevel> written_;
};

}  // namespace isobrick

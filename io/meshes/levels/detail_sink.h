#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include "io/meshes/levels/level_sink.h"
#include "io/meshes/levels/level_writer.h"

namespace isobrick::inline v0 {

/// How a mesh is divided into levels of detail.
struct LevelOptions {
  int levels = 0;  ///< 0: as many as it takes until one fragment has the whole mesh
  /// Makes normals of the triangles, weighted by area, for a mesh without any.
  bool makes_normals = false;
  int threads = 0;                                 ///< 0: all cores; never shows in the bytes
  std::uint64_t memory = std::uint64_t{16} << 20;  ///< level_memory() takes more
  std::filesystem::path scratch_beside = "-";
  /// Hears of levels, within another stage. It must outlive the sink. Null: nobody.
  Progress* progress = nullptr;
};

/// What writing a mesh with levels holds at most, LevelOptions::memory included.
std::uint64_t level_memory(const LevelOptions& options);
/// Of a budget of the whole operation, what becomes LevelOptions::memory.
std::uint64_t level_share(std::uint64_t budget);

class LevelMaker;

/// Makes levels of detail of a mesh, whose fragments a format encodes and writes. Level 0 is the
/// mesh itself; each further one is the one before with a quarter of its triangles, simplified with
/// its topology kept. Levels end early where a further one would not be clearly smaller.
///
/// What it writes depends on the mesh and the number of levels alone.
class DetailSink final : public LevelSink {
 public:
  DetailSink(std::unique_ptr<LevelWriter> writer, const LevelOptions& options);
  ~DetailSink() override;

  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override { return level_memory(options_); }

  std::vector<WrittenLevel> levels() const override;

 private:
  std::unique_ptr<LevelWriter> writer_;
  LevelOptions options_;
  std::unique_ptr<LevelMaker> maker_;  ///< once the mesh has begun
};

}  // namespace isobrick

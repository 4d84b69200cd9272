#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <tbb/task_arena.h>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "io/meshes/mesh_labelling.h"

namespace isobrick::inline v0 {

/// Writes a welded mesh as Wavefront OBJ: `v x y z` [`r g b`] [`vn x y z`] for each vertex,
/// then `f a b c` (`f a//a b//b c//c` with normals), numbers from 1 on. Decimals
/// are the shortest that read back as the same float. Text is made by `threads`
/// threads, 0 for all cores; the file never depends on them.
class ObjSink final : public MeshSink {
 public:
  /// See OutputFile for what `path` and `force` may throw.
  ObjSink(std::string path, bool force, int threads = 0, MeshLabelling labelling = {});

  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size() + faces_.size(); }
  std::uint64_t memory() const override { return memory_with(arena_.max_concurrency()); }
  /// The same before there is one.
  static std::uint64_t memory_with(int threads);

 private:
  OutputFile out_;    ///< vertices; the faces at the end
  FileWriter faces_;  ///< text as well; waits until all vertices are written
  tbb::task_arena arena_;
  MeshLabelling labelling_;
  std::vector<VertexColour> colours_;  ///< of the chunk, where all are the same
  bool has_normals_ = false, has_colours_ = false;
};

}  // namespace isobrick

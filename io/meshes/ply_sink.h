#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "io/meshes/mesh_labelling.h"

namespace isobrick::inline v0 {

/// Writes a welded mesh as binary little-endian PLY: float x y z [nx ny nz] and a
/// float for each vertex attribute, `uchar red green blue` where it has colours, faces as `list
/// uchar uint vertex_indices`. The vertex numbers are uint, not int, because a mesh may have up to
/// 2³² − 1 vertices. A unit is a comment: "unit micrometer".
class PlySink final : public MeshSink {
 public:
  /// See OutputFile for what `path` and `force` may throw. The faces come behind all vertices:
  /// so many bytes of them wait in memory, more in a file without a name.
  PlySink(std::string path, bool force, std::size_t memory = 0, MeshLabelling labelling = {});

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override;
  /// Throws Error when the mesh has more vertices than PLY's numbers can name.
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size() + faces_.size(); }
  std::uint64_t memory() const override { return memory_; }

 private:
  std::size_t memory_;
  OutputFile out_;    ///< header and vertices; the faces at the end
  FileWriter faces_;  ///< waits until all vertices are known
  MeshLabelling labelling_;
  MeshHeader header_;
  MeshSize size_;
  std::vector<VertexColour> colours_;  ///< of the chunk, where all are the same
};

}  // namespace isobrick

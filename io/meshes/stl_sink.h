#pragma once

#include <cstdint>
#include <string>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Writes binary STL: corners and a facet normal for each triangle, no sharing
/// of vertices. Degenerate triangles get the normal 0.
class StlSink final : public MeshSink {
 public:
  /// See OutputFile for what `path` and `force` may throw.
  StlSink(std::string path, bool force);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  /// Throws Error when there are more triangles than STL can count.
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }

 private:
  OutputFile out_;
  std::uint64_t triangles_ = 0;
};

}  // namespace isobrick

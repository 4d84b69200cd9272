#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "io/meshes/parted_mesh_sink.h"
#include "io/meshes/vtp_layout.h"

namespace isobrick::inline v0 {

/// Writes a welded mesh as one VTK PolyData file; see VtpLayout.
class VtpSink final : public MeshSink {
 public:
  /// See OutputFile for what `path` and `force` may throw. Normals and triangles come behind all
  /// points: so many bytes of them wait in memory, more in files without a name.
  VtpSink(std::string path, bool force, std::size_t memory = 0);

  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override { return memory_; }

 private:
  void append_widened(FileWriter& out);

  std::size_t memory_;
  OutputFile out_;                      ///< header and points; the rest at the end
  FileWriter normals_, triangles_;      ///< wait until all points are written
  std::vector<FileWriter> attributes_;  ///< so do the values of each
  VtpLayout layout_;
};

/// Writes a welded mesh as VTK partitioned PolyData (.pvtp): an index and, in
/// the folder `path`.parts, one .vtp for each run of `part_triangles`. Vertices
/// that several parts name are repeated in each; global ids identify them.
class PvtpSink final : public PartedMeshSink {
 public:
  /// See PartedOutput for what `path` and `force` may throw, and check_pvtp_name().
  /// `threads` write parts at the same time; the files never depend on them.
  PvtpSink(std::string path, bool force, std::uint64_t part_triangles = kPartTriangles,
           int threads = 1);

  void finish() override;
  std::uint64_t memory() const override;

  /// How many threads a budget of the whole operation allows, and what they take.
  static int threads_within(int threads, std::uint64_t memory);
  static std::uint64_t memory_with(int threads, std::uint64_t part_triangles = kPartTriangles);

 private:
  std::uint64_t part_triangles_;
  int threads_;
};

}  // namespace isobrick

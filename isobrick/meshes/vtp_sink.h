#pragma once

#include <cstdint>
#include <string>

#include "isobrick/io/output_file.h"
#include "isobrick/io/parted_output.h"
#include "isobrick/meshes/vtp_layout.h"
#include "isobrick/surface/mesh.h"

namespace isobrick {

/// Writes a welded mesh as one VTK PolyData file; see VtpLayout.
class VtpSink final : public MeshSink {
 public:
  /// See OutputFile for what `path` and `force` may throw.
  VtpSink(std::string path, bool force);

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override {
    return out_.writer().size() + normals_.size() + triangles_.size();
  }

 private:
  OutputFile out_;                  ///< header and points; the rest at the end
  FileWriter normals_, triangles_;  ///< wait until all points are written
  VtpLayout layout_;
};

/// Writes a welded mesh as VTK partitioned PolyData (.pvtp): an index and, in
/// the folder `path`.parts, one .vtp for each run of `part_triangles`. Vertices
/// that several parts name are repeated in each.
class PvtpSink final : public MeshSink {
 public:
  static constexpr std::uint64_t kPartTriangles = std::uint64_t{1} << 20;

  /// See PartedOutput for what `path` and `force` may throw. UsageError also for
  /// a name that XML cannot hold: not UTF-8, or with control characters.
  PvtpSink(std::string path, bool force, std::uint64_t part_triangles = kPartTriangles);

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override {
    return rows_.size() + triangles_.size() + part_bytes_ + out_.index().writer().size();
  }
  std::uint64_t memory() const override;

 private:
  std::string index_text() const;

  PartedOutput out_;
  FileWriter rows_, triangles_;  ///< the whole mesh, until it is cut
  std::uint64_t part_triangles_, part_bytes_ = 0;
  MeshSize size_;
  bool has_normals_ = false;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "io/bytes/parted_output.h"
#include "io/meshes/mesh_parts.h"

namespace isobrick::inline v0 {

/// Keeps a welded mesh in scratch files until it is whole; then a format writes it, in one file or
/// in parts of `part_triangles`.
class PartedMeshSink : public MeshSink {
 public:
  static constexpr std::uint64_t kPartTriangles = std::uint64_t{1} << 20;

  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override { return part_memory(part_triangles_); }

 protected:
  /// See PartedOutput for what `path` and `force` may throw.
  PartedMeshSink(std::string path, bool force, std::uint64_t part_triangles);

  bool has_normals() const { return has_normals_; }
  /// MeshHeader::unit.
  const std::string& unit() const { return unit_; }
  /// MeshHeader::attributes.
  const std::vector<std::string>& attributes() const { return attributes_; }
  MeshSize size() const { return size_; }
  PartedOutput& output() { return out_; }
  const PartedOutput& output() const { return out_; }
  /// What was written so far, to be read while the sink lives and its scratch files do.
  const StoredMesh& stored() const { return stored_; }

  /// Calls take(part) for the parts of the mesh, in order.
  void for_each_part(const std::function<void(const MeshPart&)>& take);
  /// Creates a file for each part of the mesh and calls write_part(file, mesh, part), on `threads`
  /// threads at a time; in order with one. Returns the number of parts of each run.
  std::vector<std::uint32_t> write_parts(
      std::string_view extension, int threads,
      const std::function<void(FileWriter&, const StoredMesh&, const MeshPart&)>& write_part);
  /// Appends the whole mesh: rows as append_rows() writes them, then triangles of UInt32.
  void append_whole(FileWriter& out);

  /// Has the rows keep colours of so many bytes, after begin() and before anything is written.
  void keep_colours(std::size_t bytes) {
    colour_bytes_ = bytes;
    stored_.row_bytes += bytes;
  }

  /// Frees what scratch files take of the memory. They are not needed any more.
  void release_scratch() {
    rows_.release();
    triangles_.release();
  }

 private:
  PartedOutput out_;
  FileWriter rows_, triangles_;  ///< scratch files of the whole mesh
  StoredMesh stored_;            ///< what is in them
  std::uint64_t part_triangles_, part_bytes_ = 0;
  RunFinder runs_;
  MeshSize size_;
  bool has_normals_ = false;
  std::size_t colour_bytes_ = 0;
  std::string unit_;
  std::vector<std::string> attributes_;
};

}  // namespace isobrick

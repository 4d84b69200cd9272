#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <isobrick/progress.h>
#include "io/meshes/gltf/glb_scene.h"
#include "io/meshes/mesh_labelling.h"
#include "io/meshes/parted_mesh_sink.h"

namespace isobrick::inline v0 {

struct GlbOptions {
  /// Positions and normals of 16 bits (KHR_mesh_quantization): positions lie on
  /// a grid whose step is the mesh's longest edge / 65535, so that no coordinate
  /// moves by more than half a step; normals are exact to 1.6e-5 a component.
  bool quantize = false;
  MeshLabelling labelling = {};
  /// Without loss (EXT_meshopt_compression), in primitives of `part_triangles`; see GlbCompressor.
  bool compress = false;
  /// What does not fit one file of this size (the length in its header has 32
  /// bits) is cut into parts.
  std::uint64_t file_bytes = std::numeric_limits<std::uint32_t>::max();
  std::uint64_t part_triangles = PartedMeshSink::kPartTriangles;
  /// Hears of what a compression takes, in finish(). May be null.
  Progress* progress = nullptr;
};

/// Writes a welded mesh as binary glTF 2.0, coordinates in world units as they
/// are; see GlbVertices for their unit. One primitive in one file; beyond GlbOptions::file_bytes
/// one primitive a part, with a buffer each in the folder `path`.parts, vertices that several parts
/// name repeated in each. A mesh without triangles is an empty scene. Vertex attributes become
/// custom ones, see GlbVertices; glTF has no NaN, for which the lowest float stands.
class GlbSink final : public PartedMeshSink {
 public:
  /// See PartedOutput for what `path` and `force` may throw, and check_meshopt() where the mesh is
  /// to be compressed.
  GlbSink(std::string path, bool force, const GlbOptions& options = {});

  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return PartedMeshSink::bytes() + compressed_bytes_; }
  std::uint64_t memory() const override { return memory_with(options_); }
  /// The same before there is one.
  static std::uint64_t memory_with(const GlbOptions& options);

 private:
  GlbPrimitive append_part(FileWriter& out, const StoredMesh& mesh, const MeshPart& part);
  void finish_whole(const GlbPrimitive& primitive);
  void finish_parts();
  void finish_compressed();
  void write_compressed_parts(FileWriter& compressed, std::vector<GlbPrimitive> primitives);

  GlbOptions options_;
  std::uint64_t compressed_bytes_ = 0;  ///< in parts
  Bounds3f bounds_;
  GlbVertices vertices_;
};

}  // namespace isobrick

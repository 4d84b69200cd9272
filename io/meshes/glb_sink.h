#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "io/meshes/gltf/glb_scene.h"
#include "io/meshes/parted_mesh_sink.h"

namespace isobrick::inline v0 {

struct GlbOptions {
  /// Positions and normals of 16 bits (KHR_mesh_quantization): positions lie on
  /// a grid whose step is the mesh's longest edge / 65535, so that no coordinate
  /// moves by more than half a step; normals are exact to 1.6e-5 a component.
  bool quantize = false;
  /// What does not fit one file of this size (the length in its header has 32
  /// bits) is cut into parts.
  std::uint64_t file_bytes = std::numeric_limits<std::uint32_t>::max();
  std::uint64_t part_triangles = PartedMeshSink::kPartTriangles;
};

/// Writes a welded mesh as binary glTF 2.0, coordinates in world units as they
/// are; see GlbVertices for their unit. One primitive in one file; beyond GlbOptions::file_bytes
/// one primitive a part, with a buffer each in the folder `path`.parts, vertices that several parts
/// name repeated in each. A mesh without triangles is an empty scene. Vertex attributes become
/// custom ones, see GlbVertices; glTF has no NaN, for which the lowest float stands.
class GlbSink final : public PartedMeshSink {
 public:
  /// See PartedOutput for what `path` and `force` may throw.
  GlbSink(std::string path, bool force, const GlbOptions& options = {});

  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

 private:
  GlbPrimitive append_part(FileWriter& out, const StoredMesh& mesh, const MeshPart& part);
  void finish_whole(const GlbPrimitive& primitive);
  void finish_parts();

  std::uint64_t file_bytes_;
  Bounds3f bounds_;
  GlbVertices vertices_;
};

}  // namespace isobrick

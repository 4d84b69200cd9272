#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/vec.h>
#include "viewer/render/gl_objects.h"
#include "viewer/render/mesh_queue.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Draws meshes into the bound framebuffer, opaque or with weights for blending.
class MeshPass {
 public:
  MeshPass();

  /// Starts a picture. `clips`: whether it has half spaces.
  void start(bool clips) { clips_ = clips; }
  /// Draws pooled meshes; consecutive ones of one block take one call.
  void draw(std::span<const MeshDraw> meshes, Vec3d eye, bool transparent);
  /// Draws a mesh in host memory.
  void draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin, Vec3d eye,
            bool transparent);

  /// Maximum triangles for one call. A software driver keeps about 500 bytes for each triangle
  /// until it has drawn it, and OpenGL cannot wait within a call.
  std::uint64_t max_triangles() const;

 private:
  /// Variants of one source.
  struct Programs {
    Programs(bool clips, bool picture_clips, bool software, bool coloured);
    GlProgram opaque, transparent;
  };

  void bind(bool clips, bool transparent, bool coloured = false);
  void bind_block(const MeshPlace& place);
  /// Waits for the previous call, so that a driver holds at most two: it draws one while it
  /// receives the next.
  void wait_for_previous_call();
  /// Fills numbers_ with 0 … count − 1: the index of each mesh's DrawParameters.
  void fill_numbers(std::size_t count);

  bool software_;
  /// Without and with vertex colours. whole_programs_: for pictures without half spaces; programs_:
  /// for unclipped and clipped meshes of the others.
  std::array<std::optional<Programs>, 2> whole_programs_;
  std::array<std::array<std::optional<Programs>, 2>, 2> programs_;
  bool clips_ = false;
  GlVertexArray vertices_;
  GlBuffer parameters_, numbers_, commands_;
  GlBuffer positions_, normals_, colours_, triangles_;  ///< of meshes in host memory
  std::size_t number_count_ = 0;
  std::vector<Triangle> finite_triangles_;
  std::optional<GlFence> last_call_;
};

}  // namespace isobrick

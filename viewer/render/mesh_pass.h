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

namespace isobrick {

/// Draws meshes into the framebuffer that is bound, opaque or weighted for blending.
class MeshPass {
 public:
  MeshPass();

  /// From now on half spaces cut what is drawn, or none does.
  void start(bool clips) { clips_ = clips; }
  /// Those that follow each other in one block of a pool with one call.
  void draw(std::span<const MeshDraw> meshes, Vec3d eye, bool transparent);
  /// One that lies in memory.
  void draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin, Vec3d eye,
            bool transparent);

  /// Triangles that should be drawn with one call. A software driver takes some 500 bytes for each
  /// until it is drawn, and is not waited for within a call.
  std::uint64_t max_triangles() const;

 private:
  /// One source in several forms.
  struct Programs {
    Programs(bool clips, bool picture_clips, bool software, bool coloured);
    GlProgram opaque, transparent;
  };

  void bind(bool clips, bool transparent, bool coloured = false);
  void bind_block(const MeshPlace& place);
  /// Waits until everything before the last call has been drawn. So a driver keeps two calls at
  /// most, and draws one while it receives the next.
  void wait_for_previous_call();
  /// Numbers 0 … count − 1, which tell each mesh's vertices what it is drawn like.
  void fill_numbers(std::size_t count);

  bool software_;
  /// Without and with colours at the vertices: where nothing is cut; elsewhere for what is not
  /// cut, and what is.
  std::array<std::optional<Programs>, 2> whole_programs_;
  std::array<std::array<std::optional<Programs>, 2>, 2> programs_;
  bool clips_ = false;
  GlVertexArray vertices_;
  GlBuffer parameters_, numbers_, commands_;
  GlBuffer positions_, normals_, colours_, triangles_;  ///< of meshes that lie in memory
  std::size_t number_count_ = 0;
  std::vector<Triangle> finite_triangles_;
  std::optional<GlFence> last_call_;
};

}  // namespace isobrick

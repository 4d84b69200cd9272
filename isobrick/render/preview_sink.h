#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "isobrick/io/output_file.h"
#include "isobrick/render/gl_context.h"
#include "isobrick/render/preview_options.h"
#include "isobrick/render/renderer.h"
#include "isobrick/surface/mesh.h"

namespace isobrick {

/// Draws the mesh into a PNG picture, off-screen, as large as fits: a mesh of one batch of
/// triangles by its own bounds, a larger one by those of the blocks that it passes through. Memory:
/// `memory`, from begin to finish, however large the mesh. Looks best with normals; without them
/// facets show.
class PreviewSink final : public MeshSink {
 public:
  /// Throws UsageError for a size that makes no sense, Error where there is no OpenGL;
  /// see OutputFile for what `path` and `force` may throw.
  PreviewSink(std::string path, bool force, const PreviewOptions& options = {});
  ~PreviewSink() override;

  /// Bytes that a picture of this size takes while it is drawn, OpenGL's driver among them.
  static std::uint64_t memory(const PreviewOptions& options);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }

 private:
  void begin_picture(const MeshBounds& frame);
  MeshBounds bounds_of_batch() const;
  void draw_batch();

  PreviewOptions options_;
  OutputFile out_;
  GlContext context_;                 ///< current only within a call: they may come from any thread
  std::optional<Renderer> renderer_;  ///< from the first triangles that are drawn
  MeshBounds largest_;                ///< that the mesh can have
  Vec3d origin_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "viewer/render/gl_context.h"
#include "viewer/render/preview_options.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Draws the mesh into a PNG picture, off-screen, framed to fill it. A mesh of one batch of
/// triangles is framed by its own bounds, a larger one by those of its active blocks. The division
/// into chunks never shows. Without normals facets are visible.
class PreviewSink final : public MeshSink {
 public:
  /// Throws UsageError for an invalid size, Error without OpenGL, and what OutputFile throws for
  /// `path` and `force`.
  PreviewSink(std::string path, bool force, const PreviewOptions& options = {});
  ~PreviewSink() override;

  /// memory() with these options.
  static std::uint64_t memory_with(const PreviewOptions& options);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }
  /// Without what OpenGL's driver takes for all pictures, Renderer::driver_memory(0).
  std::uint64_t memory() const override { return memory_with(options_); }

 private:
  void begin_picture(const MeshBounds& frame);
  MeshBounds bounds_of_batch() const;
  void add(const MeshChunk& chunk, std::span<const Triangle> triangles);
  void draw_batch();

  PreviewOptions options_;
  OutputFile out_;
  /// Current only within a call, since calls may come from any thread. Destroyed once the picture
  /// is finished.
  std::optional<GlContext> context_{std::in_place};
  std::unique_ptr<Renderer> renderer_;  ///< made for the first batch
  MeshBounds max_bounds_;               ///< maximum bounds of the mesh
  Vec3d origin_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
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

namespace isobrick {

/// Draws the mesh into a PNG picture, off-screen, as large as fits: a mesh of one batch of
/// triangles by its own bounds, a larger one by those of the blocks that it passes through. How the
/// mesh is divided into chunks never shows. Looks best with normals; without them facets show.
class PreviewSink final : public MeshSink {
 public:
  /// Throws UsageError for a size that makes no sense, Error where there is no OpenGL;
  /// see OutputFile for what `path` and `force` may throw.
  PreviewSink(std::string path, bool force, const PreviewOptions& options = {});
  ~PreviewSink() override;

  /// What memory() of such a picture is.
  static std::uint64_t memory_with(const PreviewOptions& options);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }
  /// Beside what OpenGL's driver takes for all pictures, Renderer::driver_memory(0).
  std::uint64_t memory() const override { return memory_with(options_); }

 private:
  void begin_picture(const MeshBounds& frame);
  MeshBounds bounds_of_batch() const;
  void add(const MeshChunk& chunk, std::span<const Triangle> triangles);
  void draw_batch();

  PreviewOptions options_;
  OutputFile out_;
  /// ContextGuard only within a call: they may come from any thread. Until the picture is finished.
  std::optional<GlContext> context_{std::in_place};
  std::optional<Renderer> renderer_;  ///< from the first triangles that are drawn
  MeshBounds max_bounds_;             ///< that the mesh can have
  Vec3d origin_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include "viewer/render/camera_request.h"
#include "viewer/render/gl_context.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Options of PictureSink.
struct PictureSinkOptions {
  int width = 1280, height = 960;  ///< pixels, kMinPictureEdge … kMaxPictureEdge
  CameraRequest camera;
  PictureSettings settings;
  std::optional<MeshBounds> frame;  ///< what fills the picture; nullopt: the first mesh does
  bool box = false, axes = false, scale_bar = false;
  /// Unit of the scale bar, as unit_name() returns it. Empty: that of the meshes, if they have one.
  std::string scale_bar_unit;
};

/// Draws meshes off-screen while they are made, one after another: begin … finish for each. A first
/// mesh of one batch of triangles is framed by its own bounds, a larger one by those of its active
/// blocks. The division into chunks never shows. Without normals facets are visible. Meshes in
/// another unit of length than the first one's are scaled to it.
class PictureSink final : public MeshSink {
 public:
  /// Throws UsageError for an invalid size and Error without OpenGL.
  explicit PictureSink(const PictureSinkOptions& options = {});
  ~PictureSink() override;

  /// The style of the meshes that begin later. Opaque meshes come before transparent ones.
  void set_style(const MeshStyle& style);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return 0; }
  /// Without what OpenGL's driver takes for all pictures, Renderer::driver_memory(0).
  std::uint64_t memory() const override { return memory_with(options_, has_transparent_); }
  /// The same for any options.
  static std::uint64_t memory_with(const PictureSinkOptions& options, bool transparent = false);

  /// Finishes the picture and returns it: RGBA, 4 bytes per pixel, sRGB, rows from the top. Nothing
  /// can be drawn afterwards. Throws UsageError for a scale bar in a unit that the meshes lack and
  /// Cancelled once a stop is requested.
  std::vector<std::uint8_t> end(const std::stop_token& cancel = {});

  /// OpenGL's renderer.
  const std::string& renderer_name() const { return renderer_name_; }

 private:
  void begin_picture(const MeshBounds& frame);
  MeshBounds bounds_of_batch() const;
  void add(const MeshChunk& chunk, std::span<const Triangle> triangles);
  void draw_batch();
  void draw_overlays();

  PictureSinkOptions options_;
  MeshStyle style_;
  bool has_transparent_ = false;
  /// Current only within a call, since calls may come from any thread. Destroyed once the picture
  /// is finished.
  std::optional<GlContext> context_{std::in_place};
  std::string renderer_name_;
  std::unique_ptr<Renderer> renderer_;  ///< made for the first batch
  MeshBounds frame_;                    ///< what the picture shows
  std::string unit_;                    ///< of the picture: the first unit of a mesh, or empty
  double scale_ = 1;                    ///< from the mesh's unit to the picture's
  MeshBounds max_bounds_;               ///< maximum bounds of the mesh
  Vec3d origin_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
};

}  // namespace isobrick

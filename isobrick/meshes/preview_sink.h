#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "isobrick/io/output_file.h"
#include "isobrick/meshes/preview_camera.h"
#include "isobrick/meshes/preview_raster.h"
#include "isobrick/surface/mesh.h"

namespace isobrick {

struct PreviewOptions {
  int width = 1280, height = 960;      ///< pixels, 16 … 16384
  Vec3f colour{0.87f, 0.80f, 0.70f};   ///< of the surface, sRGB in [0, 1]
  Vec3d towards_eye{0.55, -1.0, 0.5};  ///< from the volume's centre, world space
  Vec3d up{0, 0, 1};
};

/// Draws the mesh into a PNG picture. Memory: `memory`, from begin to
/// finish, however large the mesh. Looks best with normals; without them facets show.
class PreviewSink final : public MeshSink {
 public:
  /// Throws UsageError for a size that makes no sense; see OutputFile for what
  /// `path` and `force` may throw.
  PreviewSink(std::string path, bool force, const PreviewOptions& options = {});

  /// Bytes that a picture of this size takes while it is drawn.
  static std::uint64_t memory(const PreviewOptions& options);

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }

 private:
  PreviewOptions options_;
  OutputFile out_;
  std::optional<PreviewRaster> raster_;  ///< two points a pixel along each axis
  std::optional<PreviewCamera> camera_;
};

}  // namespace isobrick

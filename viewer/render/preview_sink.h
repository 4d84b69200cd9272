#pragma once

#include <cstdint>
#include <string>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "viewer/render/picture_sink.h"
#include "viewer/render/preview_options.h"

namespace isobrick::inline v0 {

/// Draws the mesh into a PNG picture, off-screen, framed to fill it: PictureSink.
class PreviewSink final : public MeshSink {
 public:
  /// Throws UsageError for an invalid size, Error without OpenGL, and what OutputFile throws for
  /// `path` and `force`.
  PreviewSink(std::string path, bool force, const PreviewOptions& options = {});

  /// memory() with these options.
  static std::uint64_t memory_with(const PreviewOptions& options);

  Indexing indexing() const override { return picture_.indexing(); }
  void begin(const MeshHeader& header) override { picture_.begin(header); }
  void write(const MeshChunk& chunk) override { picture_.write(chunk); }
  void finish() override;
  std::uint64_t bytes() const override { return out_.writer().size(); }
  /// Without what OpenGL's driver takes for all pictures, Renderer::driver_memory(0).
  std::uint64_t memory() const override { return picture_.memory(); }

 private:
  PreviewOptions options_;
  OutputFile out_;
  PictureSink picture_;
};

}  // namespace isobrick

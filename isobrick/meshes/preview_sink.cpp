#include "isobrick/meshes/preview_sink.h"

#include <fmt/format.h>

#include "isobrick/core/error.h"
#include "isobrick/io/png_file.h"
#include "isobrick/meshes/preview_shading.h"

namespace isobrick {
namespace {

constexpr int kLeast = 16, kMost = 16384;

const PreviewOptions& checked(const PreviewOptions& options) {
  for (const int edge : {options.width, options.height})
    if (edge < kLeast || edge > kMost)
      throw UsageError(fmt::format("a picture of {}x{} pixels: each edge must be {} to {}",
                                   options.width, options.height, kLeast, kMost));
  return options;
}

}  // namespace

PreviewSink::PreviewSink(std::string path, bool force, const PreviewOptions& options)
    : options_(checked(options)), out_(std::move(path), force) {}

std::uint64_t PreviewSink::memory(const PreviewOptions& options) {
  // Four points, the shaded pixel, and the pixel in the file.
  constexpr std::uint64_t pixel_bytes = 4 * 8 + 3 + 4;
  return static_cast<std::uint64_t>(options.width) * static_cast<std::uint64_t>(options.height) *
         pixel_bytes;
}

void PreviewSink::begin(const MeshHeader& header) {
  raster_.emplace(2 * options_.width, 2 * options_.height);
  camera_.emplace(header.world_lo, header.world_hi, options_.towards_eye, options_.up,
                  raster_->width(), raster_->height());
}

void PreviewSink::write(const MeshChunk& chunk) { raster_->draw(*camera_, chunk); }

void PreviewSink::finish() {
  write_png(out_, options_.width, options_.height,
            shade_preview(*raster_, camera_->pixel(), options_.colour));
  raster_.reset();
}

}  // namespace isobrick

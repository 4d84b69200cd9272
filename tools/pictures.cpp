#include "tools/pictures.h"

#include <fmt/format.h>

#include "viewer/render/preview_sink.h"

namespace isobrick::tools {
namespace {

PreviewOptions options_of(const PreviewRequest& request) {
  return {.width = request.size.width, .height = request.size.height, .camera = request.camera};
}

}  // namespace

void add_picture_size(CLI::App* app, PictureSize& size) {
  add_parsed(
      app, size, parse_picture_size,
      {"--size", "WxH", "Pixels of the picture", fmt::format("{}x{}", size.width, size.height)});
}

void add_camera(CLI::App* app, CameraRequest& camera) {
  add_parsed(app, camera, parse_camera,
             {"--camera", "PARTS",
              "azimuth=DEG,elevation=DEG,roll=DEG,zoom=X,fov=DEG,orthographic,up=X:Y:Z,from=X:Y:Z, "
              "or eye=X:Y:Z,target=X:Y:Z",
              "azimuth=30,elevation=20"});
}

std::unique_ptr<MeshSink> open_preview(const std::string& path, bool force,
                                       const PreviewRequest& request) {
  return std::make_unique<PreviewSink>(path, force, options_of(request));
}

std::uint64_t preview_memory(const PreviewRequest& request) {
  return PreviewSink::memory_with(options_of(request));
}

std::uint64_t preview_driver_memory() { return Renderer::driver_memory(0); }

}  // namespace isobrick::tools

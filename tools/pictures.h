#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <isobrick/mesh.h>
#include "tools/options.h"
#include "viewer/render/camera_request.h"

// Pictures, or their refusal in a program that was built without OpenGL.
namespace isobrick::tools {

/// A picture of each surface that is extracted.
struct PreviewRequest {
  std::string path;  ///< empty: none
  PictureSize size{1280, 960};
  CameraRequest camera;
};

/// --size and --camera, which all commands that draw have.
void add_picture_size(CLI::App* app, PictureSize& size);
void add_camera(CLI::App* app, CameraRequest& camera);

/// The sink behind --preview. Throws UsageError in a program without pictures.
std::unique_ptr<MeshSink> open_preview(const std::string& path, bool force,
                                       const PreviewRequest& request);

/// MeshSink::memory() of such a sink, and what OpenGL's driver takes besides for all of them, from
/// when the first is opened. Throw as open_preview does.
std::uint64_t preview_memory(const PreviewRequest& request);
std::uint64_t preview_driver_memory();

}  // namespace isobrick::tools

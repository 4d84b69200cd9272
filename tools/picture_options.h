#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/half_space.h"
#include "tools/options.h"
#include "viewer/render/camera_request.h"
#include "viewer/render/renderer.h"

namespace isobrick::tools {

/// What the subcommands that draw have in common.
struct PictureOptions {
  PictureSize size;
  CameraRequest camera;
  std::vector<Vec3f> colours;
  std::vector<float> opacities;
  std::vector<HalfSpace> planes;
  bool edges = false, no_occlusion = false;
};

/// Adds the options; `thing` is what has a colour, such as "mesh".
void add_picture_options(CLI::App* app, PictureOptions& options, const std::string& thing);

/// How each of `count` things is drawn. Throws UsageError when more colours or opacities
/// were given.
std::vector<MeshStyle> styles_of(const PictureOptions& options, std::size_t count,
                                 const std::string& things);

}  // namespace isobrick::tools

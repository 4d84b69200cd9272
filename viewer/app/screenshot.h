#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "viewer/app/scene_renderer.h"

namespace isobrick::inline v0 {

/// A picture to draw into a file.
struct Screenshot {
  std::string file;
  Camera camera;
};

/// A full turn of the camera in equal steps about the vertical through its target. The files are
/// FOLDER/0000.png and so on.
std::vector<Screenshot> turntable(Camera camera, Vec3d vertical, int frames,
                                  const std::string& folder);

/// Returns `file`, or if that exists the name with -2, -3, … appended.
std::filesystem::path free_name(const std::filesystem::path& file);

/// Writes the renderer's finished picture as a PNG. Throws Error if there is none, and what
/// OutputFile throws.
void write_picture(const Renderer& renderer, const std::string& file, bool force);

}  // namespace isobrick

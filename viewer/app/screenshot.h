#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "viewer/app/scene_renderer.h"

namespace isobrick {

/// A picture that is to be drawn.
struct Screenshot {
  std::string file;
  Camera camera;
};

/// A full turn of the camera in equal steps about a vertical through its target, as
/// FOLDER/0000.png and so on.
std::vector<Screenshot> turntable(Camera camera, Vec3d vertical, int frames,
                                  const std::string& folder);

/// `file`, or where it is taken its name with -2, -3 and so on behind.
std::filesystem::path free_name(const std::filesystem::path& file);

/// Writes the renderer's last finished picture as a PNG. Throws Error when there is none; see
/// OutputFile for what else it may throw.
void write_picture(const Renderer& renderer, const std::string& file, bool force);

}  // namespace isobrick

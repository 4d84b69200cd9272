#pragma once

#include <string>

#include "isobrick/window/store_picture.h"

namespace isobrick {

/// Writes the renderer's last picture as a PNG. See OutputFile for what it may throw.
void write_picture(const Renderer& renderer, const std::string& file, bool force);

/// Pictures of a full turn of the camera about a vertical through its target, as
/// FOLDER/0000.png and so on, each complete. `each` is called after every picture and
/// between drawing, and may throw.
void write_turntable(StorePicture& picture, Camera camera, int width, int height,
                     const ViewSettings& settings, Vec3d vertical, int frames,
                     const std::string& folder, bool force, const std::function<void()>& each);

}  // namespace isobrick

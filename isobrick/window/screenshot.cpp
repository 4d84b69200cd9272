#include "isobrick/window/screenshot.h"

#include <filesystem>
#include <numbers>

#include <fmt/format.h>

#include "isobrick/io/png_file.h"

namespace isobrick {

void write_picture(const Renderer& renderer, const std::string& file, bool force) {
  const std::vector<std::uint8_t> rgb = without_alpha(renderer.read_pixels());
  write_png(file, renderer.width(), renderer.height(), rgb, force);
}

void write_turntable(StorePicture& picture, Camera camera, int width, int height,
                     const ViewSettings& settings, Vec3d vertical, int frames,
                     const std::string& folder, bool force, const std::function<void()>& each) {
  std::filesystem::create_directories(folder);
  for (int frame = 0; frame < frames; ++frame) {
    picture.draw_complete(camera, width, height, settings, each);
    write_picture(picture.renderer(), fmt::format("{}/{:04}.png", folder, frame), force);
    each();
    camera.orbit(2 * std::numbers::pi / frames, 0, vertical);
  }
}

}  // namespace isobrick

#include "viewer/app/screenshot.h"

#include <numbers>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/bytes/png_file.h"

namespace isobrick::inline v0 {

std::vector<Screenshot> turntable(Camera camera, Vec3d vertical, int frames,
                                  const std::string& folder) {
  std::vector<Screenshot> shots;
  for (int frame = 0; frame < frames; ++frame) {
    shots.push_back({fmt::format("{}/{:04}.png", folder, frame), camera});
    camera.orbit(2 * std::numbers::pi / frames, 0, vertical);
  }
  return shots;
}

std::filesystem::path free_name(const std::filesystem::path& file) {
  std::filesystem::path free = file;
  for (int number = 2; std::filesystem::exists(std::filesystem::symlink_status(free)); ++number)
    free = file.parent_path() /
           fmt::format("{}-{}{}", file.stem().string(), number, file.extension().string());
  return free;
}

void write_picture(const Renderer& renderer, const std::string& file, bool force) {
  if (!renderer.has_picture()) throw Error("there is no picture yet");
  const std::vector<std::uint8_t> rgb = without_alpha(renderer.read_pixels());
  write_png(file, renderer.width(), renderer.height(), rgb, force);
}

}  // namespace isobrick

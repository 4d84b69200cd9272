#include "tools/format.h"

#include <array>
#include <cmath>

#include <fmt/format.h>

namespace isobrick::tools {

std::string human_bytes(double bytes) {
  constexpr std::array<const char*, 6> units{"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  std::size_t unit = 0;
  while (bytes >= 1000 && unit + 1 < units.size()) {
    bytes /= 1024;
    ++unit;
  }
  return unit == 0 ? fmt::format("{:.0f} B", bytes)
                   : fmt::format("{:.{}f} {}", bytes, bytes < 10 ? 2 : 1, units[unit]);
}

std::string human_count(std::uint64_t count) {
  const std::string digits = fmt::format("{}", count);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
    text += digits[i];
  }
  return text;
}

std::string human_seconds(double seconds) {
  if (seconds < 1) return fmt::format("{:.3f} s", seconds);
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<std::uint64_t>(seconds);
  return fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

std::string human_extent(Int3 extent) {
  return fmt::format("{} x {} x {}", extent.x, extent.y, extent.z);
}

std::string place_text(const Transform& transform) {
  const Vec3d spacing = transform.spacing, origin = transform.origin;
  const auto& d = transform.direction;  // the columns are where x, y and z point
  return fmt::format("spacing      {} x {} x {} {}\n", spacing.x, spacing.y, spacing.z,
                     transform.unit.empty() ? "(no unit)" : transform.unit) +
         fmt::format("origin       {}, {}, {}\n", origin.x, origin.y, origin.z) +
         fmt::format("direction    x ({}, {}, {}), y ({}, {}, {}), z ({}, {}, {})\n", d[0], d[3],
                     d[6], d[1], d[4], d[7], d[2], d[5], d[8]);
}

}  // namespace isobrick::tools

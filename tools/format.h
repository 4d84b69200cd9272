#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <isobrick/transform.h>
#include <isobrick/vec.h>

// Figures and names as people read and write them.
namespace isobrick::tools {

/// "512 B", "1.4 MiB".
std::string human_bytes(double bytes);
inline std::string human_bytes(std::uint64_t bytes) {
  return human_bytes(static_cast<double>(bytes));
}

/// "1,234,567".
std::string human_count(std::uint64_t count);

/// "0.012 s", "3.4 s", "2:05 min".
std::string human_seconds(double seconds);

/// ".ply" of "Mesh.PLY".
std::string extension_of(const std::filesystem::path& path);

/// "256 x 256 x 128".
std::string human_extent(Int3 extent);

/// The lines "spacing …", "origin …" and "direction …".
std::string place_text(const Transform& transform);

}  // namespace isobrick::tools

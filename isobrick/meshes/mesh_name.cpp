#include "isobrick/meshes/mesh_name.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>

namespace isobrick {

bool has_mesh_name(const std::filesystem::path& file) {
  constexpr std::array kExtensions{".ply", ".stl", ".obj", ".glb", ".vtp", ".pvtp"};
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

}  // namespace isobrick

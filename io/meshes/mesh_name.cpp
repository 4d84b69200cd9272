#include "io/meshes/mesh_name.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <string_view>

namespace isobrick::inline v0 {
namespace {

/// What `isobrick render` reads; the formats that are written are among them.
constexpr std::string_view kExtensions[] = {".ply",  ".stl", ".obj", ".glb",
                                            ".gltf", ".vtp", ".pvtp"};

}  // namespace

bool has_mesh_name(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(std::begin(kExtensions), std::end(kExtensions), extension) !=
         std::end(kExtensions);
}

std::string mesh_extensions() {
  std::string list;
  for (const std::string_view& extension : kExtensions) {
    if (!list.empty()) list += &extension == std::end(kExtensions) - 1 ? " or " : ", ";
    list += extension;
  }
  return list;
}

}  // namespace isobrick

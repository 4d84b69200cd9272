#include "io/meshes/readers/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string_view>

#include <isobrick/error.h>
#include "io/meshes/mesh_name.h"
#include "io/meshes/readers/mesh_readers.h"

namespace isobrick::inline v0 {

#ifndef ISOBRICK_WITH_EXPAT
std::unique_ptr<MeshFile> read_vtp(const std::string& path, std::shared_ptr<MappedFile>) {
  throw UsageError(fmt::format(
      "'{}' is VTK PolyData, which this program cannot read: it was built without expat", path));
}
#endif

std::unique_ptr<MeshFile> open_mesh_file(const std::string& path) {
  auto file = std::make_shared<MappedFile>(path);
  const auto bytes = file->bytes();
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("ply\n") || text.starts_with("ply\r")) return read_ply(path, file);
  if (text.starts_with("glTF")) return read_glb(path, file);
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (extension == ".stl") return read_stl(path, file);
  if (extension == ".obj") return read_obj(path, file);
  if (extension == ".gltf") return read_gltf(path, file);
  if (extension == ".vtp" || extension == ".pvtp") return read_vtp(path, file);
  if (extension == ".ply" || extension == ".glb")
    throw Error(fmt::format("'{}' is damaged: its {} bytes do not begin as those of {} files do",
                            path, bytes.size(), extension));
  throw UsageError(
      fmt::format("'{}' is no mesh that can be drawn: neither PLY nor GLB, and not "
                  "named {}",
                  path, mesh_extensions()));
}

}  // namespace isobrick

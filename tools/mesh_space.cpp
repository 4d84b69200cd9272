#include "tools/mesh_space.h"

#include <fmt/format.h>

#include <cmath>

#include "isobrick/core/error.h"

namespace isobrick::tools {

namespace fs = std::filesystem;

MeshBytes predict_bytes(MeshFormat format, bool normals, MeshSize size) {
  constexpr std::uint64_t header = 512, triangle_of_ply = 13, triangle_of_stl = 50;
  if (format == MeshFormat::stl) {
    const std::uint64_t file = header + size.triangles * triangle_of_stl;
    return {file, file};
  }
  // The faces wait in a scratch file until all vertices are written.
  const std::uint64_t faces = size.triangles * triangle_of_ply;
  const std::uint64_t file = header + size.vertices * (normals ? 24 : 12) + faces;
  return {file, file + faces};
}

std::uint64_t free_space(const fs::path& path) {
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::error_code failure;
  if (!fs::is_directory(folder, failure))
    throw Error(
        fmt::format("cannot create '{}': there is no folder '{}'", path.string(), folder.string()));
  const fs::space_info space = fs::space(folder, failure);
  if (failure) throw system_error("tell how full the disk is of", folder.string(), failure.value());
  return space.available;
}

std::optional<Shortage> find_shortage(
    std::span<const PlannedMesh> meshes,
    const std::function<std::uint64_t(const fs::path&)>& free_space) {
  const auto enlarged = [](std::uint64_t count, double by) {
    return static_cast<std::uint64_t>(std::ceil(static_cast<double>(count) * (1 + by)));
  };
  std::uint64_t finished = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const PlannedMesh& mesh = meshes[i];
    const MeshBytes bytes = predict_bytes(mesh_format(mesh.path), mesh.normals,
                                          {enlarged(mesh.size.vertices, mesh.uncertainty),
                                           enlarged(mesh.size.triangles, mesh.uncertainty)});
    const std::uint64_t free = free_space(mesh.path);
    if (finished + bytes.needed > free) return Shortage{i, finished + bytes.needed, free};
    finished += bytes.file;
  }
  return std::nullopt;
}

}  // namespace isobrick::tools

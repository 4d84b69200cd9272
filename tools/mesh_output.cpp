#include "tools/mesh_output.h"

#include <fmt/format.h>

#include "isobrick/core/error.h"
#include "isobrick/io/ply_sink.h"
#include "isobrick/io/stl_sink.h"
#include "tools/format.h"

namespace isobrick::tools {

namespace fs = std::filesystem;

MeshFormat mesh_format(const fs::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".ply") return MeshFormat::ply;
  if (extension == ".stl") return MeshFormat::stl;
  throw UsageError(
      fmt::format("'{}' is no mesh that can be written; name it .ply or .stl", path.string()));
}

std::unique_ptr<MeshSink> open_mesh(const fs::path& path, bool force) {
  if (mesh_format(path) == MeshFormat::ply) return std::make_unique<PlySink>(path.string(), force);
  return std::make_unique<StlSink>(path.string(), force);
}

MeshBytes predict_bytes(MeshFormat format, bool normals, const ExtractEstimate& estimate) {
  constexpr std::uint64_t header = 512, triangle_of_ply = 13, triangle_of_stl = 50;
  if (format == MeshFormat::stl) {
    const std::uint64_t file = header + estimate.triangles * triangle_of_stl;
    return {file, file};
  }
  // The faces wait in a scratch file until all vertices are written.
  const std::uint64_t faces = estimate.triangles * triangle_of_ply;
  const std::uint64_t file = header + estimate.vertices * (normals ? 24 : 12) + faces;
  return {file, file + faces};
}

fs::path with_isovalue(const fs::path& path, double isovalue) {
  fs::path name = path.stem();
  name += fmt::format("_{}", isovalue);
  name += path.extension();
  return path.parent_path() / name;
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

}  // namespace isobrick::tools

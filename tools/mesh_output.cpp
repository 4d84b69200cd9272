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

fs::path with_isovalue(const fs::path& path, double isovalue) {
  fs::path name = path.stem();
  name += fmt::format("_{}", isovalue);
  name += path.extension();
  return path.parent_path() / name;
}

}  // namespace isobrick::tools

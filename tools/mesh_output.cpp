#include "tools/mesh_output.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/bytes/parted_output.h"
#include "io/meshes/mesh_parts.h"
#include "tools/format.h"
#include "tools/output_name.h"

namespace isobrick::tools {

namespace fs = std::filesystem;

MeshFormat mesh_format(const fs::path& path) {
  if (is_standard_output(path.native())) return MeshFormat::ply;
  if (const auto format = find_mesh_format(path.extension().string())) return *format;
  throw UsageError(
      fmt::format("'{}' is no mesh that can be written; name it .ply, .stl, .obj, .glb, .vtp or "
                  ".pvtp, or add --format",
                  path.string()));
}

void check_mesh_name(const fs::path& path, MeshFormat format) {
  const std::string_view extension = isobrick::extension_of(format);
  if (is_standard_output(path.native())) {
    if (format != MeshFormat::pvtp) return;
    throw UsageError(
        "PVTP has several files, which standard output cannot take: name a file, or add --format "
        "vtp");
  }
  const std::string_view extensions[] = {extension};
  refuse_misleading_name(path.string(), extensions,
                         fmt::format("--format {} writes another format", extension.substr(1)));
}

MeshFormat parse_mesh_format(const std::string& text) {
  if (const auto format = find_mesh_format("." + text)) return *format;
  throw UsageError(
      fmt::format("'{}' is no format of a mesh; it is ply, stl, obj, glb, vtp or pvtp", text));
}

std::uint64_t mesh_bytes(const fs::path& path) {
  std::uint64_t bytes = fs::file_size(path);
  for (const fs::path& folder : part_folders(path))
    for (const FolderEntry& part : folder_entries(folder))
      bytes += fs::file_size(folder / part.name);
  return bytes;
}

fs::path with_isovalue(const fs::path& path, double isovalue) {
  fs::path name = path.stem();
  name += fmt::format("_{}", isovalue);
  name += path.extension();
  return path.parent_path() / name;
}

}  // namespace isobrick::tools

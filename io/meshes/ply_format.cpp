#include "io/meshes/ply_format.h"

#include <limits>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

/// Padding goes into a comment: some readers take a count with leading zeros for octal and some
/// choke on trailing blanks.
std::string ply_header(const MeshHeader& header, MeshSize size, const std::string& name) {
  const std::string counts = fmt::format("{}{}", size.vertices, size.triangles);
  std::string properties =
      header.has_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "";
  for (const std::string& attribute : header.attributes)
    properties += fmt::format("property float {}\n", attribute);
  if (header.has_colours)
    for (const char* channel : {"red", "green", "blue"})
      properties += fmt::format("property uchar {}\n", channel);
  const std::size_t most = 2 * std::numeric_limits<std::uint64_t>::digits10 + 2;
  return fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment Isobrick {}\n{}{}"
      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}"
      "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
      std::string(most - counts.size(), '.'),
      header.unit.empty() ? "" : fmt::format("comment unit {}\n", header.unit),
      name.empty() ? "" : fmt::format("comment name {}\n", name), size.vertices, properties,
      size.triangles);
}

void check_ply_vertices(std::uint64_t vertices, const std::string& path) {
  if (vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        fmt::format("'{}': the mesh has more than 4294967295 vertices, which PLY cannot "
                    "number; write STL instead or extract parts with --roi",
                    path));
}

}  // namespace isobrick

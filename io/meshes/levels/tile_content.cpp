#include "io/meshes/levels/tile_content.h"

#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "core/vectors.h"
#include "io/meshes/gltf/glb_scene.h"
#include "io/meshes/gltf/meshopt_codec.h"

namespace isobrick::inline v0 {
namespace {

void append(std::string& buffer, std::span<const std::byte> bytes) {
  buffer.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// The buffer of a primitive that is compressed; sets where its parts are. Triangles name vertices
/// in their order, as the encoder wants it: FragmentWelder numbers them so.
std::string compress(const GlbVertices& vertices, std::string_view rows,
                     std::span<const Triangle> triangles, GlbPrimitive& primitive) {
  std::string buffer;
  const auto add = [&](std::span<const std::byte> bytes) {
    primitive.compressed.push_back({buffer.size(), bytes.size()});
    append(buffer, bytes);
    buffer.resize((buffer.size() + 3) / 4 * 4);
  };
  const auto count = static_cast<std::size_t>(primitive.vertices);
  for (const GlbField& field : vertices.fields()) {
    std::vector<std::byte> values(count * field.bytes);
    for (std::size_t i = 0; i < count; ++i)
      std::memcpy(values.data() + i * field.bytes,
                  rows.data() + i * vertices.row_bytes() + field.offset, field.bytes);
    add(encode_rows(values, field.bytes).span());
  }
  add(encode_triangles(triangles, count).span());
  return buffer;
}

}  // namespace

float tile_coordinate(const FragmentPlace& place, std::size_t axis, std::uint16_t step) {
  const std::int64_t at = std::int64_t{place.cell[axis]} * ChunkGrid::kSteps + step;
  return static_cast<float>(static_cast<double>(at) * place.grid.edge_of(place.level) /
                            static_cast<double>(ChunkGrid::kSteps));
}

std::string tile_glb(const FragmentMesh& mesh, const FragmentPlace& place, const TileForm& form) {
  if (mesh.triangles.empty()) return {};
  GlbVertices vertices{.normals = form.normals, .turns_z_up = true, .unit = form.unit};
  if (form.colour)
    for (std::size_t i = 0; i < 3; ++i) vertices.colour[i] = linear_light((*form.colour)[i]);
  std::vector<Vec3f> rows;
  rows.reserve(mesh.points.size() * (form.normals ? 2 : 1));
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const FragmentPoint& point = mesh.points[i];
    rows.push_back({tile_coordinate(place, 0, point[0]), tile_coordinate(place, 1, point[1]),
                    tile_coordinate(place, 2, point[2])});
    // Those at cuts are means of others.
    if (form.normals) rows.push_back(to_float(unit(to_double(mesh.normals[i]), {0, 0, 1})));
  }
  GlbPrimitive primitive{.vertices = mesh.points.size(), .triangles = mesh.triangles.size()};
  primitive.vertex_bytes = primitive.vertices * vertices.row_bytes();
  std::string buffer(static_cast<std::size_t>(primitive.vertex_bytes), '\0');
  primitive.bounds =
      vertices.store(std::as_bytes(std::span(rows)), reinterpret_cast<std::byte*>(buffer.data()));
  if (form.compress)
    buffer = compress(vertices, buffer, mesh.triangles, primitive);
  else
    append(buffer, std::as_bytes(std::span(mesh.triangles)));
  return glb_start(glb_json(vertices, {&primitive, 1}), buffer.size()) + buffer;
}

}  // namespace isobrick

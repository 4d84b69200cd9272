#include "io/meshes/glb_sink.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "io/bytes/leftovers.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::string_view kPartExtension = ".bin";
/// What the JSON of one primitive and the headers take at most, and what an attribute adds.
constexpr std::uint64_t kStartBytes = 4096, kAttributeBytes = 256;

/// glTF forbids numbers that are not finite: NaN becomes the lowest float, and infinities become
/// the floats next to them.
std::vector<float> finite_values(std::span<const float> values) {
  constexpr float most = std::numeric_limits<float>::max();
  std::vector<float> finite(values.begin(), values.end());
  for (float& value : finite) value = std::isnan(value) ? -most : std::clamp(value, -most, most);
  return finite;
}

}  // namespace

GlbSink::GlbSink(std::string path, bool force, const GlbOptions& options)
    : PartedMeshSink(std::move(path), force, options.part_triangles),
      file_bytes_(options.file_bytes),
      vertices_{.quantized = options.quantize} {}

void GlbSink::begin(const MeshHeader& header) {
  PartedMeshSink::begin(header);
  vertices_.normals = header.has_normals;
  vertices_.unit = header.unit;
  vertices_.attributes = header.attributes;
}

void GlbSink::write(const MeshChunk& chunk) {
  std::vector<std::vector<float>> finite;
  std::vector<VertexAttribute> attributes;
  for (const VertexAttribute& attribute : chunk.attributes)
    attributes.push_back({attribute.name, finite.emplace_back(finite_values(attribute.values))});
  MeshChunk allowed = chunk;
  allowed.attributes = attributes;
  PartedMeshSink::write(allowed);
  bounds_.include(chunk.positions);
}

GlbPrimitive GlbSink::append_part(FileWriter& out, const StoredMesh& mesh, const MeshPart& part) {
  GlbPrimitive primitive{.vertices = part.vertices(), .triangles = part.triangles};
  primitive.vertex_bytes = part.vertices() * vertices_.row_bytes();
  for_each_row_batch(mesh, part, [&](std::span<const std::byte> rows) {
    primitive.bounds.include(vertices_.append(out, rows));
  });
  for_each_triangle_batch(mesh, part, [&](std::span<const Triangle> triangles) {
    out.append(std::as_bytes(triangles));
  });
  return primitive;
}

void GlbSink::finish_whole(const GlbPrimitive& primitive) {
  FileWriter& out = output().index().writer();
  out.append(glb_start(glb_json(vertices_, {&primitive, 1}), primitive.bytes()));
  if (vertices_.quantized)
    append_part(out, stored(), {.triangles = size().triangles, .own_vertices = size().vertices});
  else
    append_whole(out);
}

void GlbSink::finish_parts() {
  std::vector<GlbPrimitive> primitives;
  write_parts(kPartExtension, 1,
              [&](FileWriter& out, const StoredMesh& mesh, const MeshPart& part) {
                const std::string uri =
                    output().reference(part_name(part.run, part.number, kPartExtension));
                primitives.push_back(append_part(out, mesh, part));
                primitives.back().uri = percent_encoded(uri);
              });
  output().index().writer().append(glb_start(glb_json(vertices_, primitives), 0));
}

void GlbSink::finish() {
  if (vertices_.quantized) vertices_.set_grid(bounds_);
  const GlbPrimitive whole{.vertices = size().vertices,
                           .triangles = size().triangles,
                           .bounds = vertices_.stored(bounds_),
                           .vertex_bytes = size().vertices * vertices_.row_bytes()};
  if (size().triangles == 0)
    output().index().writer().append(glb_start(glb_json(vertices_, {}), 0));
  else if (!stored().wide &&
           kStartBytes + attributes().size() * kAttributeBytes + whole.bytes() <= file_bytes_)
    finish_whole(whole);
  else
    finish_parts();
  release_scratch();
  output().publish();
}

}  // namespace isobrick

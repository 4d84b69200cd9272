#include "io/meshes/glb_sink.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "io/bytes/leftovers.h"
#include "io/meshes/glb_compressor.h"
#include "io/meshes/gltf/meshopt_codec.h"

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
      options_(options),
      vertices_{.quantized = options.quantize} {
  if (options.compress) check_meshopt();
  vertices_.name = options.labelling.name;
  if (const auto& colour = options.labelling.colour)
    for (std::size_t i = 0; i < 3; ++i) vertices_.colour[i] = linear_light((*colour)[i]);
}

std::uint64_t GlbSink::memory_with(const GlbOptions& options) {
  return part_memory(options.part_triangles) +
         (options.compress ? GlbCompressor::memory_with(options.part_triangles) : 0);
}

void GlbSink::begin(const MeshHeader& header) {
  PartedMeshSink::begin(header);
  vertices_.normals = header.has_normals;
  vertices_.unit = header.unit;
  vertices_.attributes = header.attributes;
  vertices_.colours = header.has_colours;
  keep_colours(header.has_colours ? sizeof(VertexColour) : 0);
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
  if (vertices_.quantized || vertices_.colours)
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

void GlbSink::write_compressed_parts(FileWriter& compressed, std::vector<GlbPrimitive> primitives) {
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    GlbPrimitive& primitive = primitives[i];
    const std::uint64_t first = primitive.compressed.back().offset;
    const std::uint64_t end =
        i + 1 < primitives.size() ? primitives[i + 1].compressed.back().offset : compressed.size();
    const std::string name = part_name(i, 0, kPartExtension);
    primitive.uri = percent_encoded(output().reference(name));
    FileWriter out = output().create_part(name);
    out.append_range(compressed, first, end - first);
    out.finish();
    compressed_bytes_ += end - first;
    for (BufferRange& range : primitive.compressed) range.offset -= first;
  }
  output().index().writer().append(glb_start(glb_json(vertices_, primitives), 0));
}

void GlbSink::finish_compressed() {
  FileWriter compressed = open_scratch_beside(output().index().path());
  GlbCompressor compressor(vertices_, compressed, options_.part_triangles);
  Progress& progress = options_.progress ? *options_.progress : no_progress();
  progress.begin("compressing", size().triangles * sizeof(Triangle));
  for_each_part([&](const MeshPart& part) {
    compressor.add(stored(), part);
    progress.advance(part.triangles * sizeof(Triangle));
  });
  progress.end();
  release_scratch();
  std::vector<GlbPrimitive> primitives = compressor.take_primitives();
  const std::string start = glb_start(glb_json(vertices_, primitives), compressed.size());
  if (start.size() + compressed.size() > options_.file_bytes)
    return write_compressed_parts(compressed, std::move(primitives));
  output().index().writer().append(start);
  output().index().writer().append_file(compressed);
}

void GlbSink::finish() {
  if (vertices_.quantized) vertices_.set_grid(bounds_);
  const GlbPrimitive whole{.vertices = size().vertices,
                           .triangles = size().triangles,
                           .bounds = vertices_.stored(bounds_),
                           .vertex_bytes = size().vertices * vertices_.row_bytes()};
  if (size().triangles == 0)
    output().index().writer().append(glb_start(glb_json(vertices_, {}), 0));
  else if (options_.compress)
    finish_compressed();
  else if (!stored().wide && kStartBytes + attributes().size() * kAttributeBytes + whole.bytes() <=
                                 options_.file_bytes)
    finish_whole(whole);
  else
    finish_parts();
  release_scratch();
  output().publish();
}

}  // namespace isobrick

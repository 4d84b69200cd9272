#include "isobrick/meshes/glb_sink.h"

#include <utility>
#include <vector>

#include "isobrick/meshes/vertex_rows.h"

namespace isobrick {
namespace {

constexpr std::string_view kPartExtension = ".bin";
/// What the JSON of one primitive and the headers take at most.
constexpr std::uint64_t kStartBytes = 4096;

}  // namespace

GlbSink::GlbSink(std::string path, bool force, const GlbOptions& options)
    : options_(options),
      out_(std::move(path), force),
      rows_(open_scratch_beside(out_.index().path())),
      triangles_(open_scratch_beside(out_.index().path())) {}

void GlbSink::begin(const MeshHeader& header) {
  vertices_.normals = header.has_normals;
  vertices_.quantized = options_.quantize;
}

void GlbSink::write(const MeshChunk& chunk) {
  size_.vertices += chunk.positions.size();
  size_.triangles += chunk.triangles.size();
  bounds_.include(chunk.positions);
  append_rows(rows_, chunk);
  triangles_.append(std::as_bytes(chunk.triangles));
}

GlbPrimitive GlbSink::append_part(FileWriter& out, const MeshPart& part) {
  GlbPrimitive primitive{.vertices = part.vertices(), .triangles = part.triangles};
  primitive.vertex_bytes = part.vertices() * vertices_.row_bytes();
  const VertexRows rows{rows_, 0, row_bytes(vertices_.normals)};
  for_each_row_run(rows, part, [&](std::span<const std::byte> run) {
    primitive.bounds.include(vertices_.append(out, run));
  });
  for_each_triangle_run(triangles_, part,
                        [&](std::span<const Triangle> run) { out.append(std::as_bytes(run)); });
  return primitive;
}

void GlbSink::finish_whole(const GlbPrimitive& primitive) {
  FileWriter& out = out_.index().writer();
  out.append(glb_start(glb_json(vertices_, {&primitive, 1}), primitive.bytes()));
  if (vertices_.quantized)
    append_part(out, {.triangles = size_.triangles, .own_vertices = size_.vertices});
  else
    for (FileWriter* file : {&rows_, &triangles_}) out.append_file(*file);
}

void GlbSink::finish_parts() {
  std::vector<GlbPrimitive> primitives;
  for_each_part(triangles_, size_, options_.part_triangles, [&](const MeshPart& part) {
    FileWriter out = out_.create_part(kPartExtension);
    primitives.push_back(append_part(out, part));
    primitives.back().uri = percent_encoded(out_.reference(out_.parts() - 1, kPartExtension));
    out.finish();
    part_bytes_ += out.size();
  });
  out_.index().writer().append(glb_start(glb_json(vertices_, primitives), 0));
}

void GlbSink::finish() {
  if (vertices_.quantized) vertices_.set_grid(bounds_);
  const GlbPrimitive whole{.vertices = size_.vertices,
                           .triangles = size_.triangles,
                           .bounds = vertices_.stored(bounds_),
                           .vertex_bytes = size_.vertices * vertices_.row_bytes()};
  if (size_.triangles == 0)
    out_.index().writer().append(glb_start(glb_json(vertices_, {}), 0));
  else if (kStartBytes + whole.bytes() <= options_.file_bytes)
    finish_whole(whole);
  else
    finish_parts();
  out_.publish();
}

}  // namespace isobrick

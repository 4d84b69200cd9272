#include "io/meshes/ply_sink.h"

#include <utility>

#include "io/meshes/append_items.h"
#include "io/meshes/ply_format.h"
#include "io/meshes/vertex_rows.h"

namespace isobrick::inline v0 {
namespace {

void append_faces(FileWriter& out, std::span<const Triangle> triangles) {
  append_items<kPlyFaceBytes>(out, triangles.size(), [&](std::byte* to, std::uint64_t i) {
    put_ply_face(to, triangles[i]);
  });
}

}  // namespace

PlySink::PlySink(std::string path, bool force, std::size_t memory, MeshLabelling labelling)
    : memory_(memory),
      out_(std::move(path), force, Streaming::when_complete),
      faces_(open_scratch_beside(out_.path(), memory)),
      labelling_(std::move(labelling)) {}

void PlySink::begin(const MeshHeader& header) {
  header_ = header;
  header_.has_colours |= labelling_.colour.has_value();
  out_.writer().append(ply_header(header_, size_, labelling_.line()));
}

void PlySink::write(const MeshChunk& chunk) {
  size_.vertices += chunk.positions.size();
  size_.triangles += chunk.triangles.size();
  check_ply_vertices(size_.vertices, out_.path());
  append_rows(out_.writer(), labelling_.coloured(chunk, colours_), header_.has_colours ? 3 : 0);
  append_faces(faces_, chunk.triangles);
}

void PlySink::finish() {
  out_.writer().append_file(faces_);
  faces_.release();
  out_.writer().patch(0, ply_header(header_, size_, labelling_.line()));
  out_.publish();
}

}  // namespace isobrick

#include "io/meshes/ply_sink.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <limits>

#include <isobrick/error.h>
#include "io/meshes/append_items.h"
#include "io/meshes/vertex_rows.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are written as they lie");
static_assert(sizeof(Triangle) == 12);

constexpr std::size_t kFaceBytes = 13;

void append_faces(FileWriter& out, std::span<const Triangle> triangles) {
  append_items<kFaceBytes>(out, triangles.size(), [&](std::byte* to, std::uint64_t i) {
    *to = std::byte{3};
    std::memcpy(to + 1, triangles[i].data(), sizeof(Triangle));
  });
}

}  // namespace

PlySink::PlySink(std::string path, bool force, std::size_t memory)
    : memory_(memory),
      out_(std::move(path), force, Streaming::when_complete),
      faces_(open_scratch_beside(out_.path(), memory)) {}

/// Always of the same length, so that it can be replaced when the counts are
/// known. Padding goes into a comment: some readers take a count with leading
/// zeros for octal and some choke on trailing blanks.
std::string PlySink::header_text() const {
  const std::string counts = fmt::format("{}{}", vertices_, triangles_);
  std::string properties =
      has_normals_ ? "property float nx\nproperty float ny\nproperty float nz\n" : "";
  for (const std::string& name : attributes_)
    properties += fmt::format("property float {}\n", name);
  const std::size_t most = 2 * std::numeric_limits<std::uint64_t>::digits10 + 2;
  return fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment Isobrick {}\n{}"
      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}"
      "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
      std::string(most - counts.size(), '.'),
      unit_.empty() ? "" : fmt::format("comment unit {}\n", unit_), vertices_, properties,
      triangles_);
}

void PlySink::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  unit_ = header.unit;
  attributes_ = header.attributes;
  out_.writer().append(header_text());
}

void PlySink::write(const MeshChunk& chunk) {
  vertices_ += chunk.positions.size();
  triangles_ += chunk.triangles.size();
  if (vertices_ > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        fmt::format("'{}': the mesh has more than 4294967295 vertices, which PLY cannot "
                    "number; write STL instead or extract parts with --roi",
                    out_.path()));
  append_rows(out_.writer(), chunk);
  append_faces(faces_, chunk.triangles);
}

void PlySink::finish() {
  out_.writer().append_file(faces_);
  faces_.release();
  out_.writer().patch(0, header_text());
  out_.publish();
}

}  // namespace isobrick

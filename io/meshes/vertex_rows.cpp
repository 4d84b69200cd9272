#include "io/meshes/vertex_rows.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "io/meshes/append_items.h"

namespace isobrick::inline v0 {

static_assert(std::endian::native == std::endian::little, "floats are written as they lie");
static_assert(sizeof(Vec3f) == 12);

namespace {

void append_long_rows(FileWriter& out, const MeshChunk& chunk, std::size_t colour_bytes) {
  const bool normals = !chunk.normals.empty();
  const std::size_t row = row_bytes(normals, chunk.attributes.size(), colour_bytes);
  const std::size_t batch = FileWriter::kBuffer / row;
  for (std::size_t first = 0; first < chunk.positions.size(); first += batch) {
    const std::size_t end = std::min(chunk.positions.size(), first + batch);
    std::byte* to = out.reserve((end - first) * row);
    const auto put = [&to](const auto& value) {
      std::memcpy(to, &value, sizeof(value));
      to += sizeof(value);
    };
    for (std::size_t i = first; i < end; ++i) {
      put(chunk.positions[i]);
      if (normals) put(chunk.normals[i]);
      for (const VertexAttribute& attribute : chunk.attributes) put(attribute.values[i]);
      if (colour_bytes == 0) continue;
      std::memcpy(to, chunk.colours[i].data(), colour_bytes);
      to += colour_bytes;
    }
    out.commit((end - first) * row);
  }
}

}  // namespace

void append_rows(FileWriter& out, const MeshChunk& chunk, std::size_t colour_bytes) {
  if (!chunk.attributes.empty() || colour_bytes > 0)
    return append_long_rows(out, chunk, colour_bytes);
  if (chunk.normals.empty()) {
    out.append(std::as_bytes(chunk.positions));
    return;
  }
  append_items<row_bytes(true)>(out, chunk.positions.size(), [&](std::byte* to, std::uint64_t i) {
    std::memcpy(to, &chunk.positions[i], sizeof(Vec3f));
    std::memcpy(to + sizeof(Vec3f), &chunk.normals[i], sizeof(Vec3f));
  });
}

}  // namespace isobrick

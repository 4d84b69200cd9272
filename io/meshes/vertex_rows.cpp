#include "io/meshes/vertex_rows.h"

#include <bit>
#include <cstring>

#include "io/meshes/append_items.h"

namespace isobrick::inline v0 {

static_assert(std::endian::native == std::endian::little, "floats are written as they lie");
static_assert(sizeof(Vec3f) == 12);

void append_rows(FileWriter& out, const MeshChunk& chunk) {
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

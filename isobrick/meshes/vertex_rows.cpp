#include "isobrick/meshes/vertex_rows.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace isobrick {

static_assert(std::endian::native == std::endian::little, "floats are written as they lie");
static_assert(sizeof(Vec3f) == 12);

void append_rows(FileWriter& out, const MeshChunk& chunk) {
  if (chunk.normals.empty()) {
    out.append(std::as_bytes(chunk.positions));
    return;
  }
  constexpr std::size_t batch = FileWriter::kBuffer / row_bytes(true);
  for (std::size_t first = 0; first < chunk.positions.size(); first += batch) {
    const std::size_t count = std::min(batch, chunk.positions.size() - first);
    std::byte* to = out.reserve(count * row_bytes(true));
    for (std::size_t i = first; i < first + count; ++i, to += row_bytes(true)) {
      std::memcpy(to, &chunk.positions[i], sizeof(Vec3f));
      std::memcpy(to + sizeof(Vec3f), &chunk.normals[i], sizeof(Vec3f));
    }
    out.commit(count * row_bytes(true));
  }
}

}  // namespace isobrick

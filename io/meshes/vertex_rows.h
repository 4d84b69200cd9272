#pragma once

#include <cstddef>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Bytes of one vertex as append_rows writes it.
constexpr std::size_t row_bytes(bool normals, std::size_t attributes = 0,
                                std::size_t colour_bytes = 0) {
  return (normals ? 2 : 1) * sizeof(Vec3f) + attributes * sizeof(float) + colour_bytes;
}

/// Appends the chunk's vertices as rows of float x y z [nx ny nz] and the attributes, little
/// endian; with normals and attributes exactly when the chunk has them. `colour_bytes` of the
/// chunk's colours follow, 3 or 4; 0: none.
void append_rows(FileWriter& out, const MeshChunk& chunk, std::size_t colour_bytes = 0);

}  // namespace isobrick

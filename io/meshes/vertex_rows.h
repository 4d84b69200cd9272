#pragma once

#include <cstddef>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Bytes of one vertex as append_rows writes it.
constexpr std::size_t row_bytes(bool normals, std::size_t attributes = 0) {
  return (normals ? 2 : 1) * sizeof(Vec3f) + attributes * sizeof(float);
}

/// Appends the chunk's vertices as rows of float x y z [nx ny nz] and the attributes, little
/// endian; with normals and attributes exactly when the chunk has them.
void append_rows(FileWriter& out, const MeshChunk& chunk);

}  // namespace isobrick

#pragma once

#include <cstddef>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Bytes of one vertex as append_rows writes it.
constexpr std::size_t row_bytes(bool normals) { return (normals ? 2 : 1) * sizeof(Vec3f); }

/// Appends the chunk's vertices as rows of float x y z [nx ny nz], little endian;
/// with normals exactly when the chunk has them.
void append_rows(FileWriter& out, const MeshChunk& chunk);

}  // namespace isobrick

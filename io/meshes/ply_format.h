#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include <isobrick/mesh.h>

// What a binary little-endian PLY of ours consists of: a header, vertices as append_rows() writes
// them, and faces.

namespace isobrick::inline v0 {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");
static_assert(sizeof(Triangle) == 12);

inline constexpr std::size_t kPlyFaceBytes = 13;

inline void put_ply_face(std::byte* to, const Triangle& triangle) {
  *to = std::byte{3};
  std::memcpy(to + 1, triangle.data(), sizeof(Triangle));
}

/// Of the same length for every size, so that it can be replaced when the size is known. A `name`
/// of one line becomes a comment.
std::string ply_header(const MeshHeader& header, MeshSize size, const std::string& name = {});

/// Throws Error where PLY cannot number so many vertices.
void check_ply_vertices(std::uint64_t vertices, const std::string& path);

}  // namespace isobrick

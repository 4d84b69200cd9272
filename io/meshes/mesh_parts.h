#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// A run of a welded mesh's triangles with all the vertices that they name. A
/// vertex that several parts name is repeated in each; every vertex is the own
/// one of exactly one part.
struct MeshPart {
  std::uint64_t first_triangle = 0, triangles = 0;
  std::uint64_t first_vertex = 0, own_vertices = 0;
  std::span<const std::uint32_t> borrowed;  ///< of parts before, ascending

  std::uint64_t vertices() const { return own_vertices + borrowed.size(); }
  /// The number in this part, where the borrowed ones follow the own ones, of a
  /// vertex that the part has.
  std::uint32_t local(std::uint32_t vertex) const;
};

/// Cuts a welded mesh, whose triangles lie in a scratch file, into parts of
/// `part_triangles` (the last has fewer; a mesh without triangles is one part)
/// and calls `take` for each, in order. A part that borrows more vertices than an eighth of
/// that ends sooner. Where the cuts lie depends on nothing but the mesh.
void for_each_part(FileWriter& triangles, MeshSize mesh, std::uint64_t part_triangles,
                   const std::function<void(const MeshPart&)>& take);

/// Bytes that for_each_part holds at most.
std::uint64_t part_memory(std::uint64_t part_triangles);

/// A file of vertices, rows of fixed length.
struct VertexRows {
  FileWriter& file;
  std::size_t row_bytes = 0;
};

/// Calls take(bytes) for runs of whole rows, at most FileWriter::kBuffer bytes
/// each, that make up the part's vertices in its order.
void for_each_row_run(const VertexRows& rows, const MeshPart& part,
                      const std::function<void(std::span<const std::byte>)>& take);

/// Calls take(triangles) for runs of the part's triangles, with its own numbers.
void for_each_triangle_run(FileWriter& triangles, const MeshPart& part,
                           const std::function<void(std::span<const Triangle>)>& take);

}  // namespace isobrick

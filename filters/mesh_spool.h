#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/scratch_array.h"
#include "filters/vertex_numbers.h"

namespace isobrick::inline v0 {

/// Holds a welded mesh in scratch arrays until it is replayed. Vertices keep their numbers, and
/// triangles their order.
template <class Number>
class MeshSpool {
 public:
  /// Its arrays hold at most `memory` bytes together, but one page each.
  MeshSpool(const ScratchPlace& place, std::uint64_t memory);

  /// Before the first chunk: whether the mesh has normals.
  void begin(const MeshHeader& header) { has_normals_ = header.has_normals; }
  /// Takes the next chunk of the mesh. Throws Error for more vertices than numbers can name.
  void append(const MeshChunk& chunk);

  bool has_normals() const { return has_normals_; }
  MeshSize size() const { return {positions_.size(), triangles_.size()}; }
  ScratchArray<Vec3f>& positions() { return positions_; }
  /// Empty, or one a position.
  ScratchArray<Vec3f>& normals() { return normals_; }
  ScratchArray<TriangleOf<Number>>& triangles() { return triangles_; }
  /// Bytes of the mesh.
  std::uint64_t bytes() const;
  /// Bytes that the arrays hold at most.
  std::uint64_t memory() const;

  /// Writes the mesh to a sink of welded chunks, which has begun: all vertices, then all triangles.
  /// `wide`: as its header said.
  void replay(MeshSink& to, bool wide);
  /// The same, and frees each array as soon as it is written.
  void replay_and_release(MeshSink& to, bool wide);
  /// Frees memory and files.
  void release();

 private:
  void write_vertices(MeshSink& to);
  void write_triangles(MeshSink& to, bool wide);

  ScratchArray<Vec3f> positions_, normals_;
  ScratchArray<TriangleOf<Number>> triangles_;
  std::vector<TriangleOf<Number>> converted_;  ///< of a chunk
  bool has_normals_ = false;
};

}  // namespace isobrick

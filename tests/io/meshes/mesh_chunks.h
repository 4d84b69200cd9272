#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "test_meshes.h"

// A mesh as sinks get it.

namespace isobrick::inline v0 {

/// A mesh in chunks; triangles of a chunk may name vertices of those before.
struct Chunks {
  TestMesh mesh;
  std::vector<std::pair<std::size_t, std::size_t>> ends;  ///< vertices, triangles
};

/// A ball far from the origin, in pieces of about `triangles`.
inline Chunks make_chunks(std::size_t triangles, std::uint32_t rings = 40) {
  Chunks chunks{make_ball({1000.125f, -2, 3e-3f}, 7, rings), {}};
  std::size_t vertices = 0;
  for (std::size_t t = 0; t < chunks.mesh.triangles.size();) {
    const std::size_t end = std::min(t + triangles, chunks.mesh.triangles.size());
    for (; t < end; ++t)
      for (const std::uint32_t v : chunks.mesh.triangles[t])
        vertices = std::max(vertices, std::size_t{v} + 1);
    if (end == chunks.mesh.triangles.size()) vertices = chunks.mesh.positions.size();
    chunks.ends.emplace_back(vertices, end);
  }
  return chunks;
}

/// The same with all vertices before the triangles.
inline Chunks vertices_first(Chunks chunks) {
  const std::size_t vertices = chunks.mesh.positions.size(),
                    triangles = chunks.mesh.triangles.size();
  chunks.ends = {
      {vertices / 3, 0}, {vertices, 0}, {vertices, triangles / 2}, {vertices, triangles}};
  return chunks;
}

/// `wide`: with numbers of 64 bits.
inline void write(MeshSink& sink, const Chunks& chunks, bool normals, const std::string& unit = "",
                  bool wide = false) {
  EXPECT_EQ(sink.indexing(), Indexing::welded);
  MeshHeader header{normals, {0, 0, 0}, {1, 1, 1}, {}, unit};
  header.wide = wide;
  sink.begin(header);
  std::size_t v = 0, t = 0;
  for (const auto& [v_end, t_end] : chunks.ends) {
    MeshChunk chunk{.first_vertex = v};
    chunk.positions = std::span(chunks.mesh.positions).subspan(v, v_end - v);
    if (normals) chunk.normals = std::span(chunks.mesh.normals).subspan(v, v_end - v);
    chunk.triangles = std::span(chunks.mesh.triangles).subspan(t, t_end - t);
    std::vector<WideTriangle> triangles;
    if (wide) {
      for (const Triangle& narrow : chunk.triangles)
        triangles.push_back({narrow[0], narrow[1], narrow[2]});
      chunk.triangles = {};
      chunk.wide_triangles = triangles;
    }
    sink.write(chunk);
    v = v_end;
    t = t_end;
  }
  sink.finish();
}

}  // namespace isobrick

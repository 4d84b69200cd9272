#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "io/meshes/readers/mesh_file.h"
#include "tests/io/meshes/test_meshes.h"

// Mesh files that the tests write, and what is read from them.

namespace isobrick::inline v0 {

inline constexpr std::uint32_t kRings = 20;

inline void write_ball(MeshSink& sink, bool normals = true, const std::string& unit = "") {
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  sink.begin({normals, {0, 1, 2}, {2, 3, 4}, {}, unit});
  sink.write(ball.chunk(0, normals));
  sink.finish();
}

/// All corners of all triangles in the world, in the file's order.
inline std::vector<Vec3d> corners_of(const std::string& path, Vec3d origin = {1, 2, 3}) {
  std::vector<Vec3d> corners;
  open_mesh_file(path)->read(origin, [&](const MeshChunk& chunk, Vec3d from) {
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t i : t) {
        const Vec3f p = chunk.positions[i];
        corners.push_back(Vec3d{p.x, p.y, p.z} + from);
      }
  });
  return corners;
}

inline void expect_ball(const std::string& path, bool normals, double tolerance) {
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  EXPECT_EQ(file->info().faces, ball.triangles.size()) << path;
  file->read({1, 2, 3}, [&](const MeshChunk& chunk, Vec3d) {
    ASSERT_EQ(chunk.normals.size(), normals ? chunk.positions.size() : 0) << path;
    for (std::size_t i = 0; i < chunk.normals.size(); ++i) {
      const Vec3f p = chunk.positions[i], n = chunk.normals[i];
      EXPECT_NEAR(dot(p, n), std::sqrt(dot(p, p) * dot(n, n)), 1e-4) << path;
    }
  });
  Vec3d lo, hi;
  file->bounds(lo, hi);
  EXPECT_NEAR(lo.z, 2, 1e-4);
  EXPECT_NEAR(hi.z, 4, 1e-4);
  const std::vector<Vec3d> corners = corners_of(path);
  ASSERT_EQ(corners.size(), 3 * ball.triangles.size()) << path;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3f p = ball.positions[ball.triangles[i / 3][i % 3]];
    EXPECT_NEAR(corners[i].x, p.x, tolerance) << path;
    EXPECT_NEAR(corners[i].y, p.y, tolerance) << path;
    EXPECT_NEAR(corners[i].z, p.z, tolerance) << path;
  }
}

/// Everything that reading takes: opening, bounds, triangles.
inline void read_all(const std::string& path) {
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  Vec3d lo, hi;
  file->bounds(lo, hi);
  file->read(lo, [](const MeshChunk&, Vec3d) {});
}

inline std::string glb(const std::string& json, std::string binary) {
  std::string scene = json;
  scene.resize((scene.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto add = [&](std::uint32_t word) {
    bytes.append(reinterpret_cast<const char*>(&word), sizeof(word));
  };
  add(2);
  add(static_cast<std::uint32_t>(28 + scene.size() + binary.size()));
  add(static_cast<std::uint32_t>(scene.size()));
  bytes += "JSON" + scene;
  add(static_cast<std::uint32_t>(binary.size()));
  return bytes + std::string("BIN\0", 4) + binary;
}

/// The colours of the corners of all triangles.
inline std::vector<VertexColour> colours_of(const std::string& path) {
  std::vector<VertexColour> colours;
  open_mesh_file(path)->read({}, [&](const MeshChunk& chunk, Vec3d) {
    ASSERT_TRUE(chunk.colours.empty() || chunk.colours.size() == chunk.positions.size());
    if (chunk.colours.empty()) return;
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t v : t) colours.push_back(chunk.colours[v]);
  });
  return colours;
}

/// A triangle of a red, a green and a half blue corner.
inline const std::vector<VertexColour> kColours{
    {255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 128, 255}};

inline std::string coloured_ply(const std::string& kind, const std::string& full,
                                const std::string& half) {
  std::string colours;
  for (const char* name : {"red", "green", "blue"})
    colours += "property " + kind + " " + name + "\n";
  return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\n" +
         colours + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 " +
         full + " 0 0\n1 0 0 0 " + full + " 0\n0 1 0 0 0 " + half + "\n3 0 1 2\n";
}

}  // namespace isobrick

#include "filters/mesh_spool.h"

#include <algorithm>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>

namespace isobrick::test {
namespace {

/// A strip of triangles that name vertices near and far.
Mesh strip(std::uint32_t vertices) {
  Mesh mesh;
  mesh.positions.resize(vertices);
  mesh.normals.resize(vertices);
  mesh.triangles.resize(vertices - 2);
  for (std::uint32_t i = 0; i < vertices; ++i) {
    mesh.positions[i] = {float(i), 0.5F * float(i), -1};
    mesh.normals[i] = {0, float(i), 1};
    if (i + 2 < vertices) mesh.triangles[i] = {i / 3, i + 1, i + 2};
  }
  return mesh;
}

void expect_equal(const Mesh& a, const Mesh& b) {
  EXPECT_TRUE(std::ranges::equal(a.positions.span(), b.positions.span()));
  EXPECT_TRUE(std::ranges::equal(a.normals.span(), b.normals.span()));
  EXPECT_TRUE(std::ranges::equal(a.triangles.span(), b.triangles.span()));
}

TEST(MeshSpool, ReplaysWhatItTook) {
  const Mesh mesh = strip(5000);
  for (const std::uint64_t memory : {0u, 1u << 12, 1u << 24}) {
    MeshSpool<std::uint32_t> spool({.page_bytes = 256}, memory);
    spool.begin({.has_normals = true});
    spool.append({0, mesh.positions.span().first(100), mesh.normals.span().first(100),
                  mesh.triangles.span().first(98)});
    spool.append({100, mesh.positions.span().subspan(100), mesh.normals.span().subspan(100), {}});
    spool.append({5000, {}, {}, mesh.triangles.span().subspan(98)});
    EXPECT_EQ(spool.size().vertices, 5000u);
    EXPECT_EQ(spool.size().triangles, 4998u);
    EXPECT_EQ(spool.bytes(), 5000u * 24 + 4998u * 12);
    Mesh first, second;
    MemorySink to_first(first), to_second(second);
    spool.replay(to_first, false);
    spool.replay_and_release(to_second, false);
    expect_equal(first, mesh);
    expect_equal(second, mesh);
    EXPECT_EQ(spool.size().vertices, 0u);
  }
}

TEST(MeshSpool, ReplaysAMeshWithoutNormalsAndAnEmptyOne) {
  const Mesh mesh = strip(50);
  MeshSpool<std::uint32_t> spool({}, 1 << 20);
  spool.begin({});
  Mesh empty, replayed;
  MemorySink to_empty(empty), to_replayed(replayed);
  spool.replay(to_empty, false);
  EXPECT_TRUE(empty.positions.empty());
  spool.append({0, mesh.positions.span(), {}, mesh.triangles.span()});
  spool.replay(to_replayed, false);
  EXPECT_TRUE(replayed.normals.empty());
  EXPECT_TRUE(std::ranges::equal(replayed.positions.span(), mesh.positions.span()));
}

TEST(MeshSpool, RefusesMoreVerticesThanNumbersCanName) {
  EXPECT_NO_THROW(check_vertex_count<std::uint32_t>(0xffffffff));
  EXPECT_THROW(check_vertex_count<std::uint32_t>(0x100000000), Error);
}

}  // namespace
}  // namespace isobrick::test

#include "viewer/scene/mesh_cache.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <memory>

namespace isobrick::test {
namespace {

constexpr NodeKey kFine{0, {1, 2, 3}}, kCoarse{2, {0, 1, 0}};

MeshPtr mesh_of(const NodeKey& key, double isovalue, std::uint32_t coarser,
                std::size_t vertices = 0) {
  auto mesh = std::make_shared<NodeMesh>();
  mesh->key = key;
  mesh->isovalue = isovalue;
  mesh->coarser = coarser;
  mesh->mesh.positions.resize(vertices);
  return mesh;
}

TEST(MeshCache, GivesTheMeshThatMeetsTheseNeighboursElseTheOneMadeLast) {
  MeshCache cache(1 << 20, 0);
  const MeshPtr first = mesh_of(kFine, 1, 5), last = mesh_of(kFine, 1, 3);
  cache.put(first);
  cache.put(last);
  cache.put(mesh_of(kFine, 2, 7));
  EXPECT_EQ(cache.find(kFine, 1, 5), first);
  EXPECT_EQ(cache.find(kFine, 1, 7), nullptr) << "that is another isovalue's";
  EXPECT_EQ(cache.find_any(kFine, 1, 5), first);
  EXPECT_EQ(cache.find_any(kFine, 1, 7), last);
  EXPECT_EQ(cache.find_any(kCoarse, 1, 7), nullptr);
  EXPECT_TRUE(cache.has_any(kFine, 2));
  EXPECT_FALSE(cache.has_any(kFine, 3));
  EXPECT_FALSE(cache.has_any(kCoarse, 2));
  cache.put(mesh_of(kFine, 1, 5));
  EXPECT_EQ(cache.meshes(), 3u) << "that was there";
}

TEST(MeshCache, KnowsTheFinestLevelOfAnIsovalueAlsoWhenMeshesAreDropped) {
  constexpr std::size_t kVertices = 1000;
  MeshCache cache(3 * kVertices * sizeof(Vec3f) / 2, 0);
  constexpr int kNone = std::numeric_limits<int>::max();
  EXPECT_EQ(cache.finest_level(1), kNone);
  cache.put(mesh_of(kFine, 1, 0, kVertices));
  cache.put(mesh_of(kFine, 1, 1, kVertices));
  cache.put(mesh_of(kCoarse, 1, 0, kVertices));
  EXPECT_EQ(cache.finest_level(1), 0);
  EXPECT_EQ(cache.finest_level(2), kNone);

  cache.begin_use();
  EXPECT_TRUE(cache.find(kCoarse, 1, 0));
  EXPECT_TRUE(cache.shrink());
  EXPECT_EQ(cache.meshes(), 1u);
  EXPECT_EQ(cache.finest_level(1), kCoarse.level);

  cache.begin_use();
  cache.put(mesh_of(kCoarse, 2, 0, 3 * kVertices));
  EXPECT_FALSE(cache.shrink()) << "what is in use stays";
  EXPECT_EQ(cache.finest_level(1), kNone);
  EXPECT_EQ(cache.finest_level(2), kCoarse.level);
}

}  // namespace
}  // namespace isobrick::test

#include "viewer/app/mesh_uploads.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "tests/io/meshes/test_meshes.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
void fill(PodBuffer<T>& buffer, const std::vector<T>& values) {
  buffer.resize(values.size());
  std::copy(values.begin(), values.end(), buffer.data());
}

class Uploads : public testing::Test {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "there is no OpenGL 4.5";
    context_.emplace();
    pool_.emplace(kVertices);
  }
  void TearDown() override {
    uploads_.reset();
    pool_.reset();
  }

  /// Balls of 435 vertices each, from this number on.
  static Drawable balls(int first, int count, std::uint32_t rings = 14) {
    Drawable drawable;
    for (int i = first; i < first + count; ++i) {
      const TestMesh ball = make_ball({0, 0, 0}, 1, rings);
      NodeMesh mesh;
      mesh.isovalue = i;
      fill(mesh.mesh.positions, ball.positions);
      fill(mesh.mesh.normals, ball.normals);
      fill(mesh.mesh.triangles, ball.triangles);
      drawable.nodes.push_back({std::make_shared<const NodeMesh>(std::move(mesh)), 0});
    }
    return drawable;
  }
  /// Uploads as a frame of `drawable` does while `shown` is visible.
  void take(const Drawable& drawable, const Drawable& shown) {
    uploads_->begin_use();
    uploads_->keep(shown);
    EXPECT_TRUE(uploads_->add(drawable, {}, nullptr));
  }
  void expect_uploaded(const Drawable& drawable) const {
    for (const NodeDraw& node : drawable.nodes) EXPECT_NE(uploads_->find(*node.mesh), nullptr);
  }

  static constexpr std::uint32_t kVertices = 5000;  ///< room for eleven balls
  std::optional<GlContext> context_;
  std::optional<MeshPool> pool_;
  std::optional<MeshUploads> uploads_;
};

TEST_F(Uploads, WhatIsNotDrawnGoesBeforeThePoolGrows) {
  uploads_.emplace(*pool_, MeshUploads::UnusedMeshes::drop);
  Drawable shown = balls(0, 4);
  take(shown, {});
  const std::uint64_t one = uploads_->bytes();
  for (int first = 4; first < 80; first += 4) {
    const Drawable next = balls(first, 4);
    take(next, shown);
    expect_uploaded(shown);
    expect_uploaded(next);
    EXPECT_EQ(uploads_->bytes(), one);
    shown = next;
  }
  // The drawn meshes need more.
  const Drawable many = balls(100, 12);
  take(many, shown);
  expect_uploaded(shown);
  expect_uploaded(many);
  EXPECT_EQ(uploads_->bytes(), 2 * one);
}

TEST_F(Uploads, WhatIsNeededFurtherOnStays) {
  uploads_.emplace(*pool_, MeshUploads::UnusedMeshes::drop);
  const Drawable first = balls(0, 6), second = balls(6, 5);
  take(first, {});
  take(second, {});              // the pool's block is full
  Drawable next = balls(20, 1);  // then the least recently used ones
  next.nodes.insert(next.nodes.end(), first.nodes.begin(), first.nodes.end());
  MeshUploads::Limit limit;
  uploads_->begin_use();
  EXPECT_TRUE(uploads_->add(next, {}, &limit));
  EXPECT_EQ(limit.bytes, pool_->bytes() / 11) << "one is copied";
  expect_uploaded(next);
}

TEST_F(Uploads, NothingGoesForAMeshWithABlockOfItsOwn) {
  uploads_.emplace(*pool_, MeshUploads::UnusedMeshes::drop);
  const Drawable small = balls(0, 8), large = balls(100, 1, 60);
  ASSERT_GT(large.nodes[0].mesh->mesh.positions.size(), kVertices);
  take(small, {});
  take(large, {});
  expect_uploaded(large);
  expect_uploaded(small);
}

TEST_F(Uploads, ALargeMeshMayTakeSeveralPictures) {
  uploads_.emplace(*pool_, MeshUploads::UnusedMeshes::keep);
  const Drawable large = balls(0, 1, 60), other = balls(1, 2);
  const isobrick::Mesh& mesh = large.nodes[0].mesh->mesh;
  const std::uint64_t all =
      2 * mesh.positions.span().size_bytes() + mesh.triangles.span().size_bytes();
  std::uint64_t copied = 0;
  int pictures = 0;
  for (bool uploaded = false; !uploaded; ++pictures) {
    ASSERT_LT(pictures, 10);
    MeshUploads::Limit limit;
    limit.bytes = MeshUploads::Limit::kMaxBytes;  // little is left
    const std::uint64_t before = limit.bytes;
    uploads_->begin_use();
    uploaded = uploads_->add(large, {}, &limit);
    copied += limit.bytes - before;
    if (!uploaded) take(other, {});  // other meshes are uploaded and dropped meanwhile
  }
  EXPECT_GT(pictures, 2);
  EXPECT_EQ(copied, all);
  const MeshPlace& place = uploads_->find(*large.nodes[0].mesh)->place();
  std::vector<Triangle> found(mesh.triangles.size());
  glGetNamedBufferSubData(place.triangles, place.first_triangle * sizeof(Triangle),
                          static_cast<GLsizeiptr>(found.size() * sizeof(Triangle)), found.data());
  EXPECT_TRUE(std::equal(found.begin(), found.end(), mesh.triangles.begin()));
}

TEST_F(Uploads, WhatIsNotDrawnMayStay) {
  uploads_.emplace(*pool_, MeshUploads::UnusedMeshes::keep);
  const Drawable first = balls(0, 11), second = balls(11, 11);
  take(first, {});
  const std::uint64_t one = uploads_->bytes();
  take(second, {});
  expect_uploaded(first);
  EXPECT_EQ(uploads_->bytes(), 2 * one);
  uploads_->begin_use();
  uploads_->keep(second);
  uploads_->drop(one);
  expect_uploaded(second);
  EXPECT_EQ(uploads_->find(*first.nodes[0].mesh), nullptr);
  EXPECT_EQ(uploads_->bytes(), one);
}

}  // namespace
}  // namespace isobrick

#include "viewer/scene/scene.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/drawable_checks.h"
#include "tests/viewer/scene/perspective.h"

namespace isobrick::test {
namespace {

using Clock = std::chrono::steady_clock;

std::shared_ptr<MemoryBricks> gyroid() {
  constexpr Index n = 200;
  return std::make_shared<MemoryBricks>(Int3{n, n, n}, std::function<float(Int3)>([](Int3 p) {
                                          return static_cast<float>(gyroid_ball(p, n));
                                        }),
                                        MemoryBricks::Options{.brick = 32});
}

View view_from(Vec3d eye) {
  View view;
  view.eye = eye;
  view.width = view.height = 500;
  view.pixel_error = 2;
  view.view_projection = perspective_view(view.eye, {99.5, 99.5, 99.5}, {0, 1, 0}, 0.8, 1, 1, 2000);
  return view;
}

template <class F>
testing::AssertionResult comes_true(F&& what) {
  for (const auto start = Clock::now(); Clock::now() - start < std::chrono::seconds(60);) {
    if (what()) return testing::AssertionSuccess();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return testing::AssertionFailure() << "not within a minute";
}

TEST(Scene, AWindowsLoopEndsWithTheWholeCut) {
  Scene scene(gyroid(), {.threads = 2});
  EXPECT_TRUE(comes_true([&] {
    scene.update({0.0}, view_from({99.5, 99.5, 500}), {});
    return scene.drawable()->complete && scene.idle();
  }));
  const auto drawable = scene.drawable();
  EXPECT_TRUE(drawable->complete && drawable->covers);
  EXPECT_TRUE(covers(scene.tree(), *drawable, 0));
  expect_no_overlap(scene.tree().grid(), *drawable);
  EXPECT_TRUE(scene.is_newest(*drawable));
  EXPECT_GT(drawable->triangles, 10000u);
  for (const NodeDraw& node : drawable->nodes)
    for (const Vec3f p : node.mesh->mesh.positions)
      EXPECT_LT(std::abs(p.x) + std::abs(p.y) + std::abs(p.z), 200.0f) << "around the origin";
}

/// Changes isovalue and view in every frame.
TEST(Scene, UntilACutIsCoveredTheOneBeforeIsShown) {
  Scene scene(gyroid(), {.threads = 2});
  const View from = view_from({99.5, 99.5, 500});
  scene.update({0.0}, from, {});
  ASSERT_TRUE(comes_true([&] { return scene.drawable()->complete && scene.idle(); }));
  std::uint64_t version = 0;
  for (int i = 1; i <= 200; ++i) {
    const std::vector<double> isovalues{0.001 * i};
    scene.update(isovalues, view_from({99.5 + i, 99.5, 500}), {});
    EXPECT_EQ(scene.isovalues(), isovalues);
    EXPECT_EQ(scene.cut().isovalues, isovalues);
    const auto drawable = scene.drawable();
    EXPECT_EQ(drawable->isovalues, isovalues);
    EXPECT_FALSE(drawable->nodes.empty());
    EXPECT_GE(drawable->version, version) << "nothing older comes back";
    version = drawable->version;
  }
  EXPECT_TRUE(comes_true([&] { return scene.drawable()->complete && scene.idle(); }));
  EXPECT_TRUE(scene.drawable()->covers);
  EXPECT_TRUE(covers(scene.tree(), *scene.drawable(), 0.2));
}

/// Meshes that were dropped for a budget are destroyed.
TEST(Scene, KeepsNoMeshesOfCutsBefore) {
  Scene scene(gyroid(), {.threads = 2, .mesh_bytes = 12 << 20});
  const View from = view_from({99.5, 99.5, 500});
  std::vector<std::weak_ptr<const NodeMesh>> shown;
  for (const double isovalue : {0.0, 0.05, 0.1, 0.15}) {
    ASSERT_TRUE(comes_true([&] {
      scene.update({isovalue}, from, {});
      const auto drawable = scene.drawable();
      return drawable->complete && scene.idle() && drawable->isovalues[0] == isovalue;
    }));
    for (const NodeDraw& node : scene.drawable()->nodes) shown.push_back(node.mesh);
  }
  std::uint64_t bytes = 0;
  for (const auto& mesh : shown)
    if (const auto there = mesh.lock()) bytes += there->bytes();
  EXPECT_LE(bytes, scene.stream().counters().mesh_bytes);
}

TEST(Scene, ASwitchOfTheIndexIsSearchedAtOnce) {
  Scene scene(gyroid(), {.threads = 2});
  const View from = view_from({99.5, 99.5, 500});
  scene.update({0.0}, from, {});
  const auto active = scene.search().state().active;
  EXPECT_GT(active, 0u);
  ASSERT_TRUE(comes_true([&] { return scene.idle(); }));
  scene.search().use(IndexKind::octree);
  scene.search().wait();
  const auto before = scene.drawable();
  EXPECT_FALSE(scene.search().is_current(std::vector<double>{0.0}));
  scene.update({0.0}, from, {});
  EXPECT_TRUE(scene.search().is_current(std::vector<double>{0.0}));
  EXPECT_EQ(scene.search().state().active, active);
  EXPECT_TRUE(scene.is_newest(*before)) << "the same nodes";
}

}  // namespace
}  // namespace isobrick::test

#include "viewer/app/scene_renderer.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "pipeline/extract/gpu_backend.h"
#include "tests/viewer/app/scene_renderer_fixture.h"
#include "viewer/app/clip_region.h"
#include "viewer/app/pick.h"
#include "viewer/app/screenshot.h"

namespace isobrick::inline v0 {
namespace {

TEST_F(SceneRendererTest, ShowsTheSurfaceWhereItIs) {
  open(SynthKind::sphere, {96, 96, 96});
  draw();
  const auto point = pick_point(*scene_renderer_, kWidth / 2, kHeight / 2);
  ASSERT_TRUE(point);
  EXPECT_EQ(point->surface, 1u);
  // The sphere's surface is half way between isovalue and both ends of its field; all
  // its points are equally far from the middle.
  const Vec3d middle{47.5, 47.5, 47.5};
  const double radius = length(point->world - middle);
  for (const auto& [x, y] : {std::pair{130, 110}, {190, 130}, {160, 90}}) {
    const auto other = pick_point(*scene_renderer_, x, y);
    ASSERT_TRUE(other) << x << ' ' << y;
    EXPECT_NEAR(length(other->world - middle), radius, 1.0) << x << ' ' << y;
  }
  EXPECT_FALSE(pick_point(*scene_renderer_, 1, 1));
}

TEST_F(SceneRendererTest, IsTheSameTwice) {
  open(SynthKind::gyroid, {128, 128, 128});
  const auto first = pixels();
  show();
  EXPECT_EQ(pixels(), first);
}

TEST_F(SceneRendererTest, CoarseOnesLookLikeFineOnes) {
  open(SynthKind::sphere, {160, 160, 160});
  settings_.occlusion = false;
  settings_.pixel_error = 0.5f;
  const auto fine = pixels();
  const auto fine_triangles = scene_renderer_->state().triangles;
  settings_.pixel_error = 3;
  const auto coarse = pixels();
  EXPECT_LT(scene_renderer_->state().triangles, fine_triangles / 2);
  double difference = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) difference += std::abs(fine[i] - coarse[i]);
  EXPECT_LT(difference / static_cast<double>(fine.size()), 2.0);
}

TEST_F(SceneRendererTest, WhileMeshesComeInMostOfTheTimeIsTheirs) {
  open(SynthKind::gyroid, {200, 200, 200}, {.threads = 1, .backend = Backend::cpu});
  settings_.pixel_error = 0.1f;
  settings_.occlusion = settings_.multisample = false;
  const auto seconds = [] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  };
  int pictures = 0, left_out = 0;
  // If all meshes arrive within one frame, this cannot be observed.
  for (int round = 0; round < 20 && pictures == 0; ++round) {
    show({.threads = 1, .backend = Backend::cpu});
    double ended = 0, took = 0;
    do {
      const bool covered = scene_renderer_->state().covers;
      scene_renderer_->draw(camera_, kWidth / 4, kHeight / 4, settings_);
      if (!scene_renderer_->has_new_frame()) {
        ++left_out;
        continue;
      }
      if (covered && !scene_renderer_->state().complete) {
        ++pictures;
        EXPECT_GE(seconds() - ended, 2 * took);
      }
      ended = seconds();
      took = scene_renderer_->times().draw + scene_renderer_->times().finish;
    } while (!scene_renderer_->state().complete);
  }
  EXPECT_GT(pictures, 0);
  EXPECT_GT(left_out, pictures);
}

TEST_F(SceneRendererTest, CutsAndRegionsLeaveWhatTheySay) {
  open(SynthKind::sphere, {96, 96, 96});
  settings_.axis_clips[1] = {true, 0.5f, false};  // the half in front goes
  draw();
  const auto point = pick_point(*scene_renderer_, kWidth / 2, kHeight / 2);
  ASSERT_TRUE(point);
  EXPECT_GE(point->world.y, 47);
  settings_.axis_clips[1].on = false;
  settings_.region_on = true;
  settings_.region_lo = {0, 0, 0};
  settings_.region_hi = {0.001f, 1, 1};
  draw();
  EXPECT_FALSE(pick_point(*scene_renderer_, kWidth / 2, kHeight / 2));
}

TEST_F(SceneRendererTest, PlanesCutAtAnyAngleAndHideWhatIsBehindThem) {
  open(SynthKind::sphere, {160, 160, 160});
  draw();
  const auto front = pick_point(*scene_renderer_, kWidth / 2, kHeight / 2);
  ASSERT_TRUE(front);
  const auto triangles = scene_renderer_->state().triangles;
  const Vec3d middle{79.5, 79.5, 79.5};
  // The half towards the camera is clipped: the inside of the sphere's back is visible.
  const HalfSpace kept = half_space_at(middle, camera_.back * -1.0);
  settings_.planes = {{true, kept}};
  draw();
  EXPECT_LT(scene_renderer_->state().triangles, triangles) << "nodes in front are not wanted";
  const auto behind = pick_point(*scene_renderer_, kWidth / 2, kHeight / 2);
  ASSERT_TRUE(behind);
  EXPECT_TRUE(kept.contains(behind->world));
  EXPECT_FALSE(kept.contains(front->world));
  // Six planes, an axis clip and a region: a small part of the other half remains.
  settings_.planes[0].kept = {kept.normal * -1.0, -kept.least};
  for (int i = 0; i < 5; ++i) settings_.planes.push_back({true, {{0, 0, 1.0 + i}, -1e6}});
  settings_.axis_clips = {{{true, 0.99f, true}, {true, 0.99f, true}, {true, 0.01f, false}}};
  settings_.region_on = true;
  settings_.region_lo = {0.02f, 0.02f, 0.02f};
  settings_.region_hi = {0.98f, 0.98f, 0.98f};
  draw();
  const auto again = pick_point(*scene_renderer_, kWidth / 2, kHeight / 2);
  ASSERT_TRUE(again);
  EXPECT_LT(length(again->world - front->world), 1e-3);
  // A plane that is off does nothing.
  settings_ = {.surfaces = settings_.surfaces, .planes = {{false, kept}}};
  draw();
  EXPECT_EQ(scene_renderer_->state().triangles, triangles);
}

TEST(ClipTest, AreThoseThatComeNearEnough) {
  PictureSettings settings;
  settings.planes = {{{0, 0, 10}, 50}};  // z >= 5
  settings.region = WorldBox{{0, -100, -100}, {20, 100, 100}};
  const ClipTest clip_test(settings);
  EXPECT_EQ(clip_test.mask({10, 0, 20}, 9), 0u);
  EXPECT_EQ(clip_test.mask({10, 0, 10}, 5.1), 0b1u);
  EXPECT_EQ(clip_test.mask({4, 0, 20}, 5), 0b10u);
  EXPECT_EQ(clip_test.mask({16, 0, 8}, 5), 0b101u);
  EXPECT_EQ(clip_test.mask({10, 0, 20}, 1000), 0b1111111u);
  EXPECT_EQ(ClipTest(PictureSettings{}).mask({0, 0, 0}, 1e9), 0u);
}

TEST_F(SceneRendererTest, KeepsItsBudgets) {
  const PictureBudgets budgets{.memory = 48u << 20, .device_memory = 4u << 20};
  open(SynthKind::gyroid, {256, 256, 256}, budgets);
  settings_.pixel_error = 0.25f;
  draw();
  EXPECT_TRUE(scene_renderer_->state().limited_by_budget);
  EXPECT_LE(scene_renderer_->state().device_bytes, budgets.device_memory);
  EXPECT_LE(scene_renderer_->scene().stream().counters().brick_bytes_peak, budgets.memory / 2);
}

TEST_F(SceneRendererTest, IsDrawnInFullWhenTheMeshBudgetIsFull) {
  // Not even the coarsest meshes of three surfaces have room.
  const PictureBudgets budgets{.memory = 256u << 10, .threads = 1, .backend = Backend::cpu};
  open(SynthKind::gyroid, {200, 200, 200}, budgets);
  for (const double step : {30, -30}) {
    settings_.surfaces.push_back(settings_.surfaces[0]);
    settings_.surfaces.back().isovalue += step;
  }
  const auto store = std::make_shared<const StoreReader>(dir_ / "store.zarr");
  for (const bool software : {true, false}) {
    scene_renderer_ = std::make_unique<SceneRenderer>(
        store, budgets, [] {},
        std::make_shared<PictureSetup>(
            budgets, [] {}, std::nullopt, software));
    const FrameOptions options{.quality = FrameOptions::Quality::reduced_until_complete};
    const auto draw = [&] {
      scene_renderer_->draw(camera_, kWidth / 4, kHeight / 4, settings_, options);
      scene_renderer_->scene().stream().wait_idle(1);
    };
    for (int i = 0; i < 60 && (i < 3 || scene_renderer_->state().reduced_quality); ++i) draw();
    ASSERT_TRUE(scene_renderer_->scene().stream().idle());
    EXPECT_FALSE(scene_renderer_->scene().drawable()->complete) << "the test has too few meshes";
    EXPECT_FALSE(scene_renderer_->state().reduced_quality) << "software: " << software;
  }
}

TEST_F(SceneRendererTest, SlicesAndUploadsShareTheDevicesBudget) {
  const PictureBudgets budgets{
      .memory = 64u << 20, .device_memory = 8u << 20, .backend = Backend::cpu};
  open(SynthKind::gyroid, {192, 192, 192}, budgets);
  settings_.pixel_error = 0.5f;
  settings_.occlusion = settings_.multisample = false;
  std::uint64_t most = 0;
  for (int i = 0; i < 6; ++i) {
    settings_.surfaces[0].isovalue = 100.5 + 5 * i;
    for (std::size_t axis = 0; axis < 3; ++axis) settings_.slices[axis] = {i % 3 > 0, 0.5f};
    draw();
    EXPECT_LE(scene_renderer_->state().device_bytes, budgets.device_memory);
    most = std::max(most, scene_renderer_->state().device_bytes);
  }
  EXPECT_GT(most, budgets.device_memory / 2) << "the test has too few meshes";
}

TEST_F(SceneRendererTest, MeshesOnTheDeviceKeepNoneInHostMemory) {
  const PictureBudgets budgets{
      .memory = 16u << 20, .device_memory = 512u << 20, .backend = Backend::cpu};
  open(SynthKind::gyroid, {128, 128, 128}, budgets);
  settings_.pixel_error = 0.5f;
  settings_.occlusion = settings_.multisample = false;
  std::map<std::weak_ptr<const NodeMesh>, std::uint64_t, std::owner_less<>> seen;
  std::uint64_t shown = 0, all = 0;
  for (int i = 0; i < 12; ++i) {
    settings_.surfaces[0].isovalue = 90.5 + 5 * i;
    draw();
    shown = 0;
    for (const NodeDraw& node : scene_renderer_->scene().drawable()->nodes) {
      shown += node.mesh->bytes();
      all += node.mesh->bytes();
      seen[node.mesh] = node.mesh->bytes();
    }
  }
  std::uint64_t alive = 0;
  for (const auto& [mesh, bytes] : seen)
    if (!mesh.expired()) alive += bytes;
  EXPECT_GT(all, budgets.memory) << "the test has too few meshes";
  EXPECT_LE(alive, std::max(budgets.memory / 2, shown));
  EXPECT_GT(scene_renderer_->state().device_bytes, alive);
}

TEST_F(SceneRendererTest, IsTheSameWhoeverMakesTheMeshes) {
  open(SynthKind::gyroid, {200, 150, 170}, {.backend = Backend::cpu});
  settings_.pixel_error = 1;
  if (cuda_device_count() == 0) {
    EXPECT_THROW(scene_renderer_->device().use(Backend::cuda), Error);
    GTEST_SKIP() << "there is no CUDA device";
  }
  const std::vector<double> isovalues{110.5, 127.5, 140};
  std::vector<std::vector<std::uint8_t>> expected;
  for (const double isovalue : isovalues) {
    settings_.surfaces[0].isovalue = isovalue;
    expected.push_back(pixels());
  }
  EXPECT_EQ(scene_renderer_->scene().stream().counters().device_meshes_made, 0u);
  show({.backend = Backend::cuda});
  EXPECT_EQ(scene_renderer_->device().shares_memory(), !current_gl_device().software);
  for (std::size_t i = 0; i < isovalues.size(); ++i) {
    settings_.surfaces[0].isovalue = isovalues[i];
    EXPECT_EQ(pixels(), expected[i]) << isovalues[i];
  }
  const StreamCounters made = scene_renderer_->scene().stream().counters();
  EXPECT_EQ(made.device_meshes_made, made.meshes_made);
  EXPECT_EQ(made.device_failure, "");
  EXPECT_EQ(made.device_bytes > 0, scene_renderer_->device().shares_memory());
  // Switched while meshes are made, some on the CPU and some on the device.
  show({.backend = Backend::cuda});
  for (std::size_t i = 0; i < isovalues.size(); ++i) {
    scene_renderer_->device().use(i % 2 ? Backend::cuda : Backend::cpu);
    settings_.surfaces[0].isovalue = isovalues[i];
    EXPECT_EQ(pixels(), expected[i]) << isovalues[i];
  }
}

TEST_F(SceneRendererTest, KeepsTheBudgetOfADeviceThatMakesMeshes) {
  const PictureBudgets budgets{
      .memory = 256u << 20, .device_memory = 32u << 20, .backend = Backend::automatic};
  open(SynthKind::gyroid, {192, 192, 192}, budgets);
  settings_.pixel_error = 0.5f;
  for (int i = 0; i < 12; ++i) {
    settings_.surfaces[0].isovalue = 90.5 + 5 * i;
    draw();
    EXPECT_TRUE(scene_renderer_->state().covers);
    EXPECT_LE(scene_renderer_->state().device_bytes, budgets.device_memory);
  }
}

TEST_F(SceneRendererTest, WhatIsSetUpBeforeChangesNothingAndIsKept) {
  const PictureBudgets budgets{.device_memory = 64u << 20, .backend = Backend::cpu};
  open(SynthKind::gyroid, {96, 96, 96}, budgets);
  const auto expected = pixels();
  const auto store = std::make_shared<const StoreReader>(dir_ / "store.zarr");
  const auto setup = std::make_shared<PictureSetup>(
      budgets, [] {}, std::nullopt, false);
  setup->warm_up({kWidth, kHeight});
  const std::uint64_t block = setup->pool().capacity();
  EXPECT_GT(block, 0u);
  EXPECT_EQ(setup->pool().bytes(), 0u);
  for (int opened = 0; opened < 2; ++opened) {
    scene_renderer_ = std::make_unique<SceneRenderer>(
        store, budgets, [] {}, setup);
    EXPECT_FALSE(scene_renderer_->renderer().has_picture());
    EXPECT_EQ(pixels(), expected);
    EXPECT_GT(setup->pool().bytes(), 0u);
    scene_renderer_.reset();
    EXPECT_EQ(setup->pool().bytes(), 0u);
    EXPECT_EQ(setup->pool().capacity(), block);
  }
}

TEST_F(SceneRendererTest, CanBeHadWhereItCannotBeSetUpBefore) {
  const PictureBudgets budgets{.device_memory = 64u << 20, .backend = Backend::cpu};
  open(SynthKind::gyroid, {48, 48, 48}, budgets);
  const auto expected = pixels();
  const auto setup = std::make_shared<PictureSetup>(budgets, [] {});
  EXPECT_NO_THROW(setup->warm_up({1 << 24, kHeight}));
  EXPECT_FALSE(setup->renderer().has_picture());
  EXPECT_EQ(setup->pool().bytes(), 0u);
  scene_renderer_ = std::make_unique<SceneRenderer>(
      std::make_shared<const StoreReader>(dir_ / "store.zarr"), budgets, [] {}, setup);
  EXPECT_EQ(pixels(), expected);
}

TEST_F(SceneRendererTest, ADeviceThatCouldNotBeAskedForHasNotBegunToOpen) {
  if (!current_gl_device_id()) GTEST_SKIP() << "OpenGL imports no memory here";
  DeviceOpener opening(1 << 20, [] {});
  glEnable(GL_RGBA8);  // an invalid capability: an error that the next check finds
  EXPECT_THROW(opening.begin(), Error);
  EXPECT_FALSE(opening.has_begun());
  opening.begin();
  EXPECT_NO_THROW(opening.get());
}

TEST_F(SceneRendererTest, KeepsTheBudgetWhoeverMakesMeshesAndForEveryStore) {
  const PictureBudgets budgets{
      .memory = 256u << 20, .device_memory = 64u << 20, .backend = Backend::automatic};
  const auto setup = std::make_shared<PictureSetup>(budgets, [] {});
  open(SynthKind::gyroid, {192, 192, 192}, budgets);
  settings_.pixel_error = 0.5f;
  settings_.occlusion = settings_.multisample = false;
  scene_renderer_.reset();
  const auto store = std::make_shared<const StoreReader>(dir_ / "store.zarr");
  for (int opened = 0; opened < 2; ++opened) {
    scene_renderer_ = std::make_unique<SceneRenderer>(
        store, budgets, [] {}, setup);
    for (int i = 0; i < 6; ++i) {
      scene_renderer_->device().use(i < 3 ? Backend::automatic : Backend::cpu);
      settings_.surfaces[0].isovalue = 90.5 + 5 * i + 2.5 * opened;
      draw();
      EXPECT_TRUE(scene_renderer_->state().covers);
      EXPECT_LE(scene_renderer_->state().device_bytes, budgets.device_memory) << opened << ' ' << i;
      EXPECT_GE(scene_renderer_->state().device_bytes, scene_renderer_->device().allocated_bytes());
    }
  }
}

TEST_F(SceneRendererTest, ADamagedBrickIsMarkedAndTheRestIsShown) {
  open(SynthKind::sphere, {96, 96, 96});
  damage_bricks();
  show();
  settings_.pixel_error = 0.5f;
  draw();
  EXPECT_FALSE(scene_renderer_->state().damage.empty());
  EXPECT_GT(scene_renderer_->state().triangles, 100u);
  const auto rgba = scene_renderer_->renderer().read_pixels();
  int red = 0;  // no other part of the picture is red
  for (std::size_t i = 0; i < rgba.size(); i += 4)
    red += rgba[i] > 150 && rgba[i + 1] < 90 && rgba[i + 2] < 90;
  EXPECT_GT(red, 100) << "lines around what cannot be shown, and through it";
}

TEST_F(SceneRendererTest, SlicesShowSamples) {
  open(SynthKind::sphere, {96, 96, 96});
  settings_.occlusion = settings_.multisample = false;
  settings_.surfaces[0].shown = false;
  settings_.slices[1] = {true, 0.5f};
  choose_values(settings_, scene_renderer_->scene().tree());
  camera_ = Camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1});
  const WorldBox box = scene_renderer_->bounds();
  camera_.fit(box.lo, box.hi, static_cast<double>(kWidth) / kHeight);
  const auto rgba = pixels();
  const auto grey = [&](int x, int y) {
    return rgba[static_cast<std::size_t>(y * kWidth + x) * 4];
  };
  // The field is largest in the middle and falls off to all sides alike.
  EXPECT_GT(grey(kWidth / 2, kHeight / 2), grey(kWidth / 2, kHeight / 2 - 60) + 20);
  EXPECT_NEAR(grey(kWidth / 2, kHeight / 2 - 50), grey(kWidth / 2 + 50, kHeight / 2), 6);
}

TEST_F(SceneRendererTest, TurntablesTurn) {
  open(SynthKind::gyroid, {48, 48, 48});
  const std::vector<Screenshot> turn = turntable(camera_, {0, 0, 1}, 3, "turn"),
                                other = turntable(camera_, {0, 1, 0}, 3, "y");
  ASSERT_EQ(turn.size(), 3U);
  EXPECT_EQ(turn[2].file, "turn/0002.png");
  const auto pixels_of = [&](const Screenshot& shot) {
    camera_ = shot.camera;
    return pixels();
  };
  const auto first = pixels_of(turn[0]), second = pixels_of(turn[1]);
  EXPECT_EQ(first, pixels_of(other[0]));
  EXPECT_NE(second, pixels_of(other[1]));
  EXPECT_NE(first, second);
}

}  // namespace
}  // namespace isobrick

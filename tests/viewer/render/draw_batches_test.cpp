#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/pictures.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = 230, kHeight = 170;

/// A picture with every kind of content: intersecting opaque and transparent meshes of several pool
/// blocks, one with a block of its own; slices of both kinds; planes, edges, lines, text.
class DrawBatches : public RenderTest {
 protected:
  void SetUp() override {
    RenderTest::SetUp();
    if (IsSkipped()) return;
    pool_.emplace(3000);
    for (int i = 0; i < 9; ++i) {
      const float step = static_cast<float>(i), at = -0.8f + 0.2f * step;
      const TestMesh ball = make_ball({at, 0.3f * std::sin(4 * step), -at}, 0.5f, i == 4 ? 60 : 24);
      meshes_.push_back(pool_->add(ball.chunk()));
    }
    for (std::size_t i = 0; i < samples_.size(); ++i)
      samples_[i] =
          i % 7 == 3 ? std::numeric_limits<float>::quiet_NaN() : 0.01f * static_cast<float>(i % 90);
  }
  void TearDown() override {
    meshes_.clear();
    pool_.reset();
    RenderTest::TearDown();
  }

  void begin(const PictureSettings& settings, double turn = 0) {
    Camera camera({0.4, -1, 0.3}, {0, 0, 0}, {0, 0, 1});
    camera.fit({-1, -1, -1}, {1, 1, 1}, double{kWidth} / kHeight);
    camera.orbit(turn, 0, {0, 0, 1});
    renderer().begin(camera, kWidth, kHeight, settings);
    for (std::size_t i = 0; i < meshes_.size(); ++i) {
      const float blue = 0.1f * static_cast<float>(i);
      renderer().draw(meshes_[i], {.colour = {0.9f, 0.4f, blue},
                                   .opacity = i % 3 == 1 ? 0.4f : 1.0f,
                                   .id = static_cast<std::uint32_t>(i + 1)});
    }
    SliceImage slice{.corner = {-1, 0.2, -1},
                     .along_x = {2, 0, 0},
                     .along_y = {0, 0, 2},
                     .width = 30,
                     .height = 20,
                     .samples = samples_};
    renderer().draw(slice);
    slice.corner.y = -0.5;
    slice.opacity = 0.3f;
    renderer().draw(slice);
    renderer().draw_box({-1, -1, -1}, {1, 1, 1}, {0.2f, 0.2f, 0.2f});
    renderer().draw_axes();
    renderer().draw_scale_bar("mm");
  }

  /// Returns the number of batches.
  int draw_in_batches(std::uint64_t work) {
    int batches = 1;
    while (!renderer().advance(work)) ++batches;
    return batches;
  }

  std::vector<std::uint32_t> ids() {
    std::vector<std::uint32_t> all;
    for (int y = 0; y < kHeight; y += 3)
      for (int x = 0; x < kWidth; x += 3) {
        const auto picked = renderer().pick(x, y);
        all.push_back(picked ? picked->id : 99);
      }
    return all;
  }

  std::optional<MeshPool> pool_;
  std::vector<PooledMesh> meshes_;
  std::vector<float> samples_ = std::vector<float>(30 * 20);
};

PictureSettings with_everything(bool multisample) {
  PictureSettings settings{.multisample = multisample, .edges = true, .picking = true};
  settings.planes = {{{0.2, 1, 0.1}, -0.6}};
  return settings;
}

/// Concentric balls, each larger than the one before by `larger`, added to a pool in `order`.
std::vector<PooledMesh> add_shells(MeshPool& pool, const std::vector<std::size_t>& order,
                                   float larger) {
  std::vector<PooledMesh> shells(order.size());
  for (const std::size_t i : order)
    shells[i] = pool.add(make_ball({0, 0, 0}, 0.3f + larger * static_cast<float>(i), 24).chunk());
  return shells;
}

TEST_F(DrawBatches, MeshesMayBeDrawnByTheBlocksThatTheyLieIn) {
  const auto picture = [&](bool opaque, bool in_order, std::uint64_t work) {
    MeshPool pool(1500);
    std::vector<PooledMesh> balls;
    std::set<unsigned> blocks;
    for (int i = 0; i < 12; ++i) {  // apart, so that the order does not show
      const float at = -0.8f + 0.14f * static_cast<float>(i);
      balls.push_back(pool.add(make_ball({at, 0, -at}, 0.05f, 24).chunk(), {0, 0, 0.1 * (i % 3)}));
      blocks.insert(balls.back().place().positions);
    }
    EXPECT_GT(blocks.size(), 2u);
    Camera camera({0.4, -1, 0.3}, {0, 0, 0}, {0, 0, 1});
    camera.fit({-1, -1, -1}, {1, 1, 1}, double{kWidth} / kHeight);
    renderer().begin(camera, kWidth, kHeight,
                     {.multisample = false, .occlusion = false, .in_order = in_order});
    for (std::size_t i = 0; i < 12; ++i) {
      const std::size_t ball =
          i * 5 % 12;  // four of each style, never two of a style in a row within a block
      const auto style = static_cast<std::uint32_t>(ball / 4);
      renderer().draw(balls[ball], {.colour = {0.9f, 0.4f, 0.2f * static_cast<float>(style)},
                                    .opacity = opaque ? 1.0f : 0.5f,
                                    .id = style + 1});
    }
    while (!renderer().advance(work)) {
    }
    auto pixels = renderer().read_pixels();
    for (const auto id : ids()) pixels.push_back(static_cast<std::uint8_t>(id));
    renderer().discard();
    return pixels;
  };
  for (const bool opaque : {true, false}) {
    const auto expected = picture(opaque, true, std::uint64_t{1} << 40);
    EXPECT_TRUE(picture(opaque, false, std::uint64_t{1} << 40) == expected) << opaque;
    EXPECT_TRUE(picture(opaque, false, 500) == expected) << opaque;
    EXPECT_TRUE(picture(opaque, true, 500) == expected) << opaque;
  }
}

TEST_F(DrawBatches, WhereMeshesLieDoesNotShow) {
  const auto picture = [&](bool opaque, const std::vector<std::size_t>& order) {
    MeshPool pool(3000);
    const std::vector<PooledMesh> shells = add_shells(pool, order, opaque ? 0 : 0.05f);
    Camera camera({0.4, -1, 0.3}, {0, 0, 0}, {0, 0, 1});
    camera.fit({-1, -1, -1}, {1, 1, 1}, double{kWidth} / kHeight);
    renderer().begin(camera, kWidth, kHeight, {.multisample = false, .occlusion = false});
    for (std::size_t i = 0; i < shells.size(); ++i)
      renderer().draw(shells[i], {.colour = {0.9f, 0.4f, 0.1f * static_cast<float>(i)},
                                  .opacity = opaque ? 1 : 0.3f + 0.05f * static_cast<float>(i)});
    renderer().end();
    auto pixels = renderer().read_pixels();
    renderer().discard();
    return pixels;
  };
  for (const bool opaque : {false, true}) {
    const auto expected = picture(opaque, {0, 1, 2, 3, 4, 5, 6, 7});
    EXPECT_EQ(picture(opaque, {7, 2, 5, 0, 3, 6, 1, 4}), expected) << opaque;
    EXPECT_EQ(picture(opaque, {7, 6, 5, 4, 3, 2, 1, 0}), expected) << opaque;
  }
}

TEST_F(DrawBatches, OfAnySizeGiveTheSameBytes) {
  for (const bool multisample : {false, true}) {
    begin(with_everything(multisample));
    const std::uint64_t all = renderer().work_left();
    renderer().end();
    EXPECT_EQ(renderer().work_left(), 0u);
    const auto expected = renderer().read_pixels();
    const auto expected_ids = ids();
    for (const std::uint64_t work :
         {std::uint64_t{97}, std::uint64_t{2500}, all / 2, all / 10 * 9}) {
      renderer().discard();
      begin(with_everything(multisample));
      EXPECT_EQ(renderer().work_left(), all);
      EXPECT_GE(draw_in_batches(work), work == 97 ? 100 : 2) << work;
      EXPECT_EQ(renderer().work_left(), 0u);
      EXPECT_EQ(renderer().read_pixels(), expected) << work << ' ' << multisample;
      EXPECT_EQ(ids(), expected_ids) << work << ' ' << multisample;
    }
    begin(with_everything(multisample));
    EXPECT_EQ(draw_in_batches(all), 1);
    EXPECT_EQ(renderer().read_pixels(), expected);
  }
}

TEST_F(DrawBatches, KeepThePreviousPictureUntilTheNextOneIsFinished) {
  begin(with_everything(false));
  EXPECT_FALSE(renderer().has_picture());
  EXPECT_FALSE(renderer().pick(kWidth / 2, kHeight / 2));
  renderer().end();
  const auto first = renderer().read_pixels();
  const auto first_ids = ids();
  // Another view with multisampling: first dropped when it is nearly finished, then finished.
  for (const bool dropped : {true, false}) {
    begin(with_everything(true), 1.5);
    const std::uint64_t all = renderer().work_left();
    while (!renderer().advance(1500)) {
      ASSERT_EQ(renderer().read_pixels(), first);
      if (dropped && renderer().work_left() < all / 5) break;
    }
    EXPECT_EQ(renderer().work_left() > 0, dropped);
    if (!dropped) break;
    EXPECT_EQ(ids(), first_ids);
  }
  EXPECT_NE(renderer().read_pixels(), first);
  // A dropped picture leaves no state.
  begin(with_everything(false));
  draw_in_batches(4000);
  EXPECT_EQ(renderer().read_pixels(), first);
}

TEST_F(DrawBatches, MayBeOfAnotherSizeThanThePreviousPicture) {
  begin(with_everything(false));
  renderer().end();
  const auto first = renderer().read_pixels();
  renderer().begin(Camera({0, -3, 0}, {0, 0, 0}, {0, 0, 1}), 40, 30, {});
  renderer().draw(meshes_[4], {});
  ASSERT_FALSE(renderer().advance(1000));
  EXPECT_EQ(renderer().width(), kWidth);
  EXPECT_EQ(renderer().read_pixels(), first);
  renderer().end();
  EXPECT_EQ(renderer().width(), 40);
  EXPECT_EQ(renderer().read_pixels().size(), 40u * 30 * 4);
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <isobrick/volume_source.h>
#include "tests/viewer/app/scene_renderer_fixture.h"

namespace isobrick::inline v0 {
namespace {

/// Rods along z, four samples thick: coarse levels lose them.
class Rods final : public VolumeSource {
 public:
  Rods() {
    info_.extent = {192, 192, 192};
    info_.type = ScalarType::u8;
    info_.name = "rods";
  }
  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  void read(Box3 box, std::byte* out) override {
    const auto in_rod = [](Index at) { return at % 36 >= 14 && at % 36 < 18; };
    for_each_point(box, [&](Int3 p) {
      *out++ = static_cast<std::byte>(in_rod(p.x) && in_rod(p.y) ? 200 : 0);
    });
  }

 private:
  VolumeInfo info_;
};

class ThinPreview : public SceneRendererTest {
 protected:
  void SetUp() override {
    SceneRendererTest::SetUp();
    if (IsSkipped()) return;
    Rods rods;
    NoProgress progress;
    convert(rods, dir_ / "store.zarr", {.brick = 32}, progress);
    show({.backend = Backend::cpu});
    settings_.surfaces = {{128, surface_colour(0), 1, true}};
    settings_.box = settings_.axes = settings_.scale_bar = false;
    settings_.occlusion = settings_.multisample = false;
  }
  /// Draws a preview of 2,000 triangles with all meshes resident.
  std::vector<std::uint8_t> preview(std::uint64_t thin_triangles) {
    const FrameOptions options{.max_triangles = 2'000,
                               .thin_triangles = thin_triangles,
                               .quality = FrameOptions::Quality::reduced,
                               .moving = true};
    for (int i = 0; i < 20; ++i) {  // each cut refines the previous one's nodes
      scene_renderer_->draw(camera_, kWidth, kHeight, settings_, options);
      scene_renderer_->scene().stream().wait_idle(10);
    }
    EXPECT_TRUE(scene_renderer_->state().moving);
    EXPECT_FALSE(scene_renderer_->state().complete) << "a preview never is";
    EXPECT_TRUE(scene_renderer_->state().limited);
    return scene_renderer_->renderer().read_pixels();
  }
  static std::size_t different(const std::vector<std::uint8_t>& a,
                               const std::vector<std::uint8_t>& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i + 4 <= a.size(); i += 4)
      count += !std::equal(a.begin() + static_cast<std::ptrdiff_t>(i),
                           a.begin() + static_cast<std::ptrdiff_t>(i + 4),
                           b.begin() + static_cast<std::ptrdiff_t>(i));
    return count;
  }
};

TEST_F(ThinPreview, HasWhatCoarseLevelsHaveLost) {
  settings_.surfaces[0].shown = false;
  const auto nothing = pixels();
  settings_.surfaces[0].shown = true;
  const auto whole = pixels();
  const std::size_t rods = different(whole, nothing);
  ASSERT_GT(rods, kWidth * kHeight / 20u);
  EXPECT_LT(different(preview(0), nothing), rods / 20);
  EXPECT_FALSE(scene_renderer_->state().thin_over_budget);
  EXPECT_GT(different(preview(FramePacer::kThinTriangles), nothing), rods * 6 / 10)
      << "a coarse rod is thinner";
  EXPECT_TRUE(scene_renderer_->state().thin_over_budget);
  EXPECT_LE(scene_renderer_->state().triangles, FramePacer::kThinTriangles);
  EXPECT_EQ(pixels(), whole) << "previews change nothing of it";
}

/// Previews are enlarged: thin structure is searched for at the size that is shown.
TEST_F(ThinPreview, HasItInASmallerPictureAsWell) {
  FrameOptions options{.max_triangles = 2'000,
                       .thin_triangles = FramePacer::kThinTriangles,
                       .quality = FrameOptions::Quality::reduced,
                       .moving = true};
  const auto finest = [&] {
    for (int i = 0; i < 20; ++i) {
      scene_renderer_->draw(camera_, kWidth / 4, kHeight / 4, settings_, options);
      scene_renderer_->scene().stream().wait_idle(10);
    }
    return scene_renderer_->state().triangles;
  };
  const std::uint64_t as_it_is = finest();
  options.size_divisor = 4;
  EXPECT_GT(finest(), as_it_is + 10'000);
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "tests/viewer/app/scene_renderer_fixture.h"
#include "viewer/app/pick.h"

// Pictures of several surfaces.

namespace isobrick::inline v0 {
namespace {

TEST_F(SceneRendererTest, SeveralSurfacesAreToldApart) {
  open(SynthKind::sphere, {96, 96, 96});
  const double isovalue = settings_.surfaces[0].isovalue;
  settings_.surfaces = {{isovalue + 60, surface_colour(0), 1, true},
                        {isovalue, surface_colour(1), 1, true}};
  draw();
  EXPECT_EQ(pick_point(*scene_renderer_, kWidth / 2, kHeight / 2)->surface, 2u);
  settings_.surfaces[1].shown = false;
  draw();
  EXPECT_EQ(pick_point(*scene_renderer_, kWidth / 2, kHeight / 2)->surface, 1u);
}

TEST_F(SceneRendererTest, SurfacesThatAreHiddenAreNotTakenForOthers) {
  open(SynthKind::gyroid, {64, 64, 64});
  settings_.surfaces = {{90, surface_colour(0), 1, true},
                        {120, surface_colour(1), 1, true},
                        {150, surface_colour(2), 1, true}};
  draw();
  for (std::size_t hidden = 0; hidden < 3; ++hidden) {
    settings_.surfaces[hidden].shown = false;
    scene_renderer_->draw(camera_, kWidth, kHeight, settings_);
    for (std::size_t i = 0; i < 3; ++i) {
      const double shown = scene_renderer_->state().isovalues[i];
      EXPECT_EQ(std::isnan(shown), i == hidden) << i;
      EXPECT_TRUE(shown == settings_.surfaces[i].isovalue || i == hidden);
    }
    settings_.surfaces[hidden].shown = true;
    draw();
  }
}

}  // namespace
}  // namespace isobrick

#include "viewer/app/viewer_window.h"

#include <gtest/gtest.h>

#include <epoxy/gl.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <functional>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/synth_source.h>
#include "core/vectors.h"
#include "tests/viewer/app/imgui_version.h"
#include "tests/viewer/app/window_test.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = test::kWindowWidth, kHeight = test::kWindowHeight;
using Window = test::WindowTest;
constexpr int kFieldRow = 155;  ///< of the first isovalue, on the panel

TEST_F(Window, ShowsAStore) {
  ViewerWindow& window = open();
  // The first picture may be a preview.
  until([&] { return window.state().scene_renderer->state().triangles > 1000u; });
  EXPECT_TRUE(window.state().messages.empty());
  // The middle of the picture shows the sphere, its corner nothing.
  Renderer& renderer = window.state().scene_renderer->renderer();
  EXPECT_TRUE(renderer.pick(renderer.width() / 2, renderer.height() / 2));
  EXPECT_FALSE(renderer.pick(2, 2));
}

TEST_F(Window, DragsMoveTheCameraAndSpinsRunOut) {
  ViewerWindow& window = open();
  const Vec3d eye = window.state().navigator.camera.eye;
  drag(1, 300, 240, 400, 260);
  EXPECT_GT(length(window.state().navigator.camera.eye - eye), 1);
  until([&] { return !window.state().navigator.is_moving(); });
  const double distance = window.state().navigator.camera.distance();
  display_->button(4, true);
  display_->button(4, false);
  steps(4);
  EXPECT_LT(window.state().navigator.camera.distance(), distance * 0.95);
  const Vec3d target = window.state().navigator.camera.target;
  drag(2, 300, 240, 350, 240);
  EXPECT_GT(length(window.state().navigator.camera.target - target), 1);
}

TEST_F(Window, KeysMoveTheIsovalueAndThePictureFollows) {
  ViewerWindow& window = open();
  const double before = window.state().settings.surfaces[0].isovalue;
  const auto triangles = window.state().scene_renderer->state().triangles;
  for (int i = 0; i < 8; ++i) {
    display_->tap(XK_bracketright);
    steps(1);
  }
  until([&] {
    return window.state().settings.surfaces[0].isovalue > before &&
           window.state().scene_renderer->state().complete;
  });
  EXPECT_NE(window.state().scene_renderer->state().triangles, triangles);
}

TEST_F(Window, TheSliderMovesTheIsovalue) {
  ViewerWindow& window = open();
  window.state().panels = true;
  until([&] { return window.state().isovalue_stats->histogram() != nullptr; });
  steps(3);
  const double before = window.state().settings.surfaces[0].isovalue;
  drag(1, 100, 80, 220, 80);  // within the histogram, on the panel
  EXPECT_NE(window.state().settings.surfaces[0].isovalue, before);
}

TEST_F(Window, KeysCutTheVolume) {
  ViewerWindow& window = open();
  const Renderer& renderer = window.state().scene_renderer->renderer();
  const auto whole = renderer.read_pixels();
  display_->tap(XK_1);
  until([&] { return window.state().settings.axis_clips[0].on; });
  until([&] { return window.state().scene_renderer->state().complete; });
  steps(2);
  EXPECT_NE(renderer.read_pixels(), whole);
}

/// If previews have full quality, no still frame is drawn after them.
TEST_F(Window, RestsAfterMotionThatLeftNothingOut) {
  ViewerWindow& window = open();
  until([&] { return is_still(); });
  window.state().pacer = FramePacer(10);
  drag(1, kWidth / 2, kHeight / 2, kWidth / 2 + 60, kHeight / 2);
  until([&] { return !window.state().navigator.is_moving(); });
  until([&] { return is_still(); });
}

TEST_F(Window, KeysThatAreHeldDoMostThingsOnce) {
  ViewerWindow& window = open();
  const bool box = window.state().settings.box;
  const double isovalue = window.state().settings.surfaces[0].isovalue;
  const auto hold = [&](unsigned long key) {
    display_->key(key, true);
    const auto start = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - start < std::chrono::milliseconds(1200)) steps(1);
    display_->key(key, false);
    steps(2);
  };
  hold(XK_b);
  EXPECT_NE(window.state().settings.box, box);
  hold(XK_bracketright);
  const double step = window.state().isovalue_stats->counts().range().hi / 200;
  EXPECT_GT(window.state().settings.surfaces[0].isovalue, isovalue + 2.5 * step);
}

TEST_F(Window, KeysThatComeAtOnceAreTyped) {
  ViewerWindow& window = open();
  window.state().panels = true;
  until([&] { return window.state().isovalue_stats->histogram() != nullptr; });
  steps(3);
  display_->key(XK_Control_L, true);
  click(140, kFieldRow);  // the field of the isovalue, all of it selected
  display_->key(XK_Control_L, false);
  steps(2);
  for (const unsigned long key : {XK_1, XK_5, XK_0, XK_Return}) display_->tap(key);
  steps(4);
  EXPECT_EQ(window.state().settings.surfaces[0].isovalue, 150);
}

TEST_F(Window, ThePictureHasWhatThePanelLeaves) {
  ViewerWindow& window = open();
  window.state().panels = true;
  steps(3);
  until([&] { return is_still(); });
  EXPECT_LE(window.state().panel_width, 0.6f * kWidth + 1);
  EXPECT_EQ(window.state().scene_renderer->renderer().width(), kWidth)
      << "a panel of more than half is over it";
  ImGui::SetWindowSize("###panel", {250, static_cast<float>(kHeight)});
  display_->move_pointer(kWidth / 2, 20);  // nothing is drawn before something happens
  steps(3);
  until([&] {
    return is_still() && window.state().scene_renderer->renderer().width() == kWidth - 250;
  });
  EXPECT_EQ(window.state().scene_renderer->renderer().height(), kHeight);
  // The middle of the remaining area shows the middle of the sphere, also for a click.
  display_->tap(XK_r);
  steps(3);
  until([&] { return is_still(); });
  click(250 + (kWidth - 250) / 2, kHeight / 2);
  ASSERT_TRUE(window.state().picked);
  const Vec3d middle{47.5, 47.5, 47.5};
  const Camera& camera = window.state().navigator.camera;
  const Vec3d across = window.state().picked->world - middle;
  EXPECT_LT(std::abs(dot(across, camera.right)), 2);
  EXPECT_LT(std::abs(dot(across, camera.up)), 2);
  // `R` fits the surface into it, and with shift the whole volume.
  const auto is_seen = [&](double lo, double hi) {
    bool all = true;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3d p =
          camera.project({corner & 1 ? hi : lo, corner & 2 ? hi : lo, corner & 4 ? hi : lo},
                         kWidth - 250, kHeight);
      all &= p.x >= 0 && p.x <= kWidth - 250 && p.y >= 0 && p.y <= kHeight;
    }
    return all;
  };
  const double radius = length(across), surface = camera.distance();
  EXPECT_TRUE(is_seen(47.5 - radius, 47.5 + radius));
  display_->key(XK_Shift_L, true);
  display_->tap(XK_r);
  display_->key(XK_Shift_L, false);
  steps(3);
  until([&] { return is_still(); });
  EXPECT_TRUE(is_seen(0, 95));
  EXPECT_GT(camera.distance(), surface) << "the surface fills more of it";
  display_->tap(XK_h);
  until([&] { return is_still() && window.state().scene_renderer->renderer().width() == kWidth; });
}

TEST_F(Window, ShowsHelpForF1AndQuestionMark) {
  ViewerWindow& window = open();
  display_->tap(XK_F1);
  until([&] { return window.state().help; });
  display_->tap(XK_Escape);
  until([&] { return !window.state().help; });
  display_->key(XK_Shift_L, true);
  display_->tap(XK_slash);
  display_->key(XK_Shift_L, false);
  until([&] { return window.state().help; });
  EXPECT_TRUE(window.step(0)) << "Escape has closed the window";
}

TEST_F(Window, ShowsNoFrameWhereNothingChanges) {
  ViewerWindow& window = open();
  window.state().panels = true;
  until([&] { return is_still() && window.state().isovalue_stats->histogram() != nullptr; });
  steps(20);
  const std::size_t before = window.state().frame_number;
  const std::clock_t used = std::clock();
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(window.step(0.25));
  EXPECT_EQ(window.state().frame_number, before);
  EXPECT_LT(static_cast<double>(std::clock() - used) / CLOCKS_PER_SEC, 0.06) << "of two seconds";
  display_->move_pointer(100, 300);
  steps(3);
  EXPECT_GT(window.state().frame_number, before);
}

TEST_F(Window, IsNotBlackAtFirst) {
  WindowOptions options;
  options.width = kWidth;
  options.height = kHeight;
  ViewerWindow window(options);
  EXPECT_GT(display_->pixel(window.handle(), 5, 5) >> 16, 30u) << "the background of a first frame";
}

TEST_F(Window, HasTheCharactersThatItWrites) {
  open();
  for (const ImWchar character :
       std::initializer_list<ImWchar>{0x2026, 0xb5, 0xb0, 0x2212, 0x3b1, 0x416})
    EXPECT_TRUE(test::has_glyph(character)) << character;
}

TEST_F(Window, SurvivesOtherSizesAndNone) {
  ViewerWindow& window = open();
  for (const auto& [width, height] : {std::pair{300, 200}, {611, 97}, {1, 1}, {kWidth, kHeight}}) {
    glfwSetWindowSize(window.handle(), width, height);
    steps(6);
  }
  until([&] { return window.state().scene_renderer->renderer().width() == kWidth; });
  glfwHideWindow(window.handle());
  steps(5);
  glfwShowWindow(window.handle());
  until([&] { return window.state().scene_renderer->state().complete; });
}

TEST_F(Window, DrawsNothingWhileItIsMinimised) {
  ViewerWindow& window = open();
  until([&] { return is_still(); });
  display_->minimise(window.handle());
  until([&] { return glfwGetWindowAttrib(window.handle(), GLFW_ICONIFIED) == GLFW_TRUE; });
  const std::uint64_t before = window.state().scene_renderer->counters().finished;
  window.state().settings.surfaces[0].isovalue -= 20;
  const auto start = std::chrono::steady_clock::now();
  steps(5);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(window.state().scene_renderer->counters().finished, before);
  EXPECT_GT(spent.count(), 0.04) << "nor does it spin";
  display_->restore(window.handle());
  until([&] { return is_still() && window.state().scene_renderer->counters().finished > before; });
  EXPECT_EQ(window.state().scene_renderer->state().isovalues[0],
            window.state().settings.surfaces[0].isovalue);
}

TEST_F(Window, ClosesAtOnceWhileItStreams) {
  make_store("big.zarr", {320, 320, 320});
  double least = 1;
  for (int i = 0; i < 4 && least > 0.1; ++i) {  // other processes may keep the cores busy
    ViewerWindow& window = open();
    window.open(dir_ / "big.zarr");
    window.state().settings.pixel_error = 0.1f;  // much to do, also for previews
    steps(2);
    EXPECT_FALSE(window.state().scene_renderer->state().complete);
    const auto start = std::chrono::steady_clock::now();
    window_.reset();
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    least = std::min(least, spent.count());
  }
  EXPECT_LT(least, 0.1);
}

TEST_F(Window, InputDropsAPictureAtRestThatTakesLong) {
  const auto source =
      make_synth({.kind = SynthKind::gyroid, .extent = {200, 200, 200}, .frequency = 4});
  NoProgress progress;
  convert(*source, dir_ / "many.zarr", {}, progress);
  ViewerWindow& window = open({.batch_seconds = 0.01});
  window.open(dir_ / "many.zarr");
  window.state().settings.pixel_error = 0.2f;
  const SceneRenderer& scene_renderer = *window.state().scene_renderer;
  const auto is_finished = [&] {
    return scene_renderer.state().complete && !scene_renderer.state().reduced_quality;
  };
  until(is_finished);
  steps(15);  // nothing moves any more
  until(is_finished);
  // A still frame of the same view, with edges.
  window.state().settings.edges = true;
  glfwPostEmptyEvent();
  until([&] { return scene_renderer.state().drawing; });
  const FrameCounters before = scene_renderer.counters();
  const Vec3d eye = window.state().navigator.camera.eye;
  // Pointer motion without effect on the view keeps it.
  display_->move_pointer(kWidth / 2 + 5, kHeight / 2);
  steps(1);
  EXPECT_EQ(scene_renderer.counters().dropped, before.dropped);
  EXPECT_TRUE(scene_renderer.state().drawing) << "the test has too few triangles";
  display_->button(1, true);
  steps(1);
  EXPECT_EQ(scene_renderer.counters().finished, before.finished)
      << "the test has too few triangles";
  display_->move_pointer(kWidth / 2 + 80, kHeight / 2 + 20);
  until([&] { return length(window.state().navigator.camera.eye - eye) > 1; });
  // If the motion arrives in parts, the next frame is dropped as well.
  EXPECT_GT(scene_renderer.counters().dropped, before.dropped);
  display_->button(1, false);
  until(is_finished);
  EXPECT_GT(scene_renderer.counters().finished, before.finished);
}

TEST_F(Window, ClosesWithinADrawBatch) {
  const auto source = make_synth({.kind = SynthKind::gyroid, .extent = {200, 200, 200}});
  NoProgress progress;
  convert(*source, dir_ / "many.zarr", {}, progress);
  ViewerWindow& window = open({.batch_seconds = 0.01});
  window.open(dir_ / "many.zarr");
  window.state().settings.pixel_error = 0.2f;
  const SceneRenderer& scene_renderer = *window.state().scene_renderer;
  until([&] { return scene_renderer.state().complete && !scene_renderer.state().reduced_quality; });
  steps(15);
  window.state().settings.edges = !window.state().settings.edges;
  glfwPostEmptyEvent();
  until([&] { return scene_renderer.state().drawing; });
  const FrameCounters before = scene_renderer.counters();
  glfwSetWindowShouldClose(window.handle(), GLFW_TRUE);
  EXPECT_FALSE(window.step());
  EXPECT_EQ(scene_renderer.counters().unfinished_batches, before.unfinished_batches)
      << "no further batch is drawn";
}

TEST_F(Window, WhileMeshesComeInItTakesNoStepForNothing) {
  make_store("big.zarr", {320, 320, 320});
  WindowOptions options;
  options.budgets.threads = 1;
  ViewerWindow& window = open(options);
  window.open(dir_ / "big.zarr");
  window.state().settings.pixel_error = 0.5f;
  const SceneRenderer& scene_renderer = *window.state().scene_renderer;
  const SceneStream& stream = window.state().scene_renderer->scene().stream();
  const auto opened = std::chrono::steady_clock::now();
  until([&] {
    return scene_renderer.state().complete && !scene_renderer.has_new_frame() &&
           std::chrono::steady_clock::now() - opened > std::chrono::milliseconds(400);
  });  // nothing moves any more
  int pauses = 0;
  for (int round = 0; round < 20 && pauses < 3; ++round) {
    window.state().settings.surfaces[0].isovalue += 2;  // not reported as motion
    steps(1);
    while (!scene_renderer.state().complete) {
      const bool busy = scene_renderer.has_new_frame() || scene_renderer.state().drawing ||
                        scene_renderer.state().needs_draw;
      const auto start = std::chrono::steady_clock::now();
      steps(1);
      if (busy || stream.idle()) continue;  // the last mesh ends a pause
      ++pauses;
      EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(7));
    }
    until([&] { return scene_renderer.state().complete && !scene_renderer.has_new_frame(); });
  }
  EXPECT_GE(pauses, 3);
}

TEST(ViewerWindow, SaysThatThereIsNoDisplay) {
  if (std::getenv("DISPLAY") != nullptr && *std::getenv("DISPLAY") != '\0')
    GTEST_SKIP() << "there is a display";
  EXPECT_TRUE(message_of<Error>([] { ViewerWindow window({}); }).find("--screenshot") !=
              std::string::npos);
}

}  // namespace
}  // namespace isobrick

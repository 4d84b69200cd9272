#include <signal.h>

#include <chrono>
#include <filesystem>

#include "core/cancel.h"
#include "tests/tools/program.h"
#include "tests/viewer/app/window_test.h"

namespace isobrick::inline v0 {
namespace {

/// How a window ends, or does not end.
class WindowEnd : public test::WindowTest {
 protected:
  void TearDown() override { detail::cancel_requested = false; }

  /// Writes a volume that takes some time to convert.
  void drop_much() {
    const std::string file = dir_.write("b_1024x1024x1024_uint8.raw", "");
    std::filesystem::resize_file(file, std::uintmax_t{1} << 30);
    window_->drop(file);
    ASSERT_NE(window_->state().import, nullptr);
  }
};

TEST_F(WindowEnd, ComesWhenOneIsAskedForAndLeavesNothingUnfinished) {
  open();
  drop_much();
  EXPECT_TRUE(window_->step(0.02));
  request_cancel();
  window_->run();
  window_.reset();
  // The cache keeps what is done, for the next time.
  EXPECT_EQ(dir_.list(),
            (std::vector<std::string>{"b_1024x1024x1024_uint8.raw", "cache", "sphere.zarr"}));
}

TEST_F(WindowEnd, EscapeCancelsAConversionFirst) {
  ViewerWindow& window = open();
  drop_much();
  EXPECT_TRUE(window.step(0.02));
  display_->tap(XK_Escape);
  const auto start = std::chrono::steady_clock::now();
  while (window.state().import != nullptr &&
         std::chrono::steady_clock::now() - start < std::chrono::seconds(60))
    ASSERT_TRUE(window.step(0.02)) << "the window is closed";
  EXPECT_EQ(window.state().import, nullptr);
  EXPECT_EQ(window.state().path, dir_ / "sphere.zarr");
  display_->tap(XK_Escape);
  for (int i = 0; i < 50 && window.step(0.02); ++i) continue;
  EXPECT_FALSE(window.step(0.02));
}

TEST_F(WindowEnd, PicturesReplaceNoOther) {
  ViewerWindow& window = open();
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(dir_ / "");
  while (!window.state().scene_renderer->renderer().has_picture()) ASSERT_TRUE(window.step(0.02));
  for (std::size_t i = 0; i < 2; ++i) {
    window.state().requests.screenshot = "isobrick.png";
    const auto start = std::chrono::steady_clock::now();
    // Saves the still frame, as soon as there is one.
    while (window.state().messages.size() <= i &&
           std::chrono::steady_clock::now() - start < std::chrono::seconds(60))
      ASSERT_TRUE(window.step(0.02));
  }
  std::filesystem::current_path(before);
  ASSERT_EQ(window.state().messages.size(), 2u);
  EXPECT_TRUE(contains(window.state().messages[0].text, "/isobrick.png'"));
  EXPECT_TRUE(contains(window.state().messages[1].text, "/isobrick-2.png'"));
  EXPECT_TRUE(std::filesystem::exists(dir_ / "isobrick-2.png"));
}

#ifdef ISOBRICK_PROGRAM
TEST_F(WindowEnd, TheProgramEndsOfASignal) {
  const test::Arguments words{
      "timeout", "-s",      "KILL",          "30", ISOBRICK_PROGRAM, "view", dir_ / "sphere.zarr",
      "--size",  "320x240", "--no-occlusion"};
  EXPECT_EQ(test::run_process(words, {.interrupt_after = 2}).signal, SIGINT);
}

TEST_F(WindowEnd, WithoutAStoreTheProgramWaitsForOne) {
  const test::Arguments words{"timeout", "-s", "KILL", "30", ISOBRICK_PROGRAM, "view"};
  const test::Outcome outcome = test::run_process(words, {.interrupt_after = 2});
  EXPECT_EQ(outcome.signal, SIGINT) << outcome.err;
}
#endif

}  // namespace
}  // namespace isobrick

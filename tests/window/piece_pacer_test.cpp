#include "isobrick/window/piece_pacer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>

namespace isobrick {
namespace {

TEST(PiecePacer, FindsOutHowMuchIsDrawnInATime) {
  PiecePacer pacer(true);
  const auto drawn = [&](std::uint64_t work, double seconds) {
    pacer.told(work, seconds);
    pacer.drawn_all(0);
  };
  // 4 million triangles a second, and a millisecond for each piece.
  const auto seconds_of = [](std::uint64_t work) { return 1e-3 + static_cast<double>(work) / 4e6; };
  EXPECT_LT(seconds_of(pacer.work(0.06)), 0.06) << "the first piece is a small one";
  for (int i = 0; i < 5; ++i) {
    const std::uint64_t work = pacer.work(0.06);
    drawn(work, seconds_of(work));
  }
  EXPECT_NEAR(seconds_of(pacer.work(0.06)), 0.06, 0.003);
  drawn(100'000, 0.5);  // it has become slow at once
  EXPECT_LE(pacer.work(0.06), 12'000u);
  for (int i = 0; i < 100; ++i) drawn(pacer.work(1e-6), 1);
  EXPECT_GE(pacer.work(1e-6), 1000u) << "what pieces cost must not make them smaller and smaller";
  PiecePacer device(false);
  EXPECT_EQ(device.work(0.06), std::numeric_limits<std::uint64_t>::max());
}

TEST(PiecePacer, NoSmallRestIsLeft) {
  PiecePacer pacer(true);
  for (int i = 0; i < 20; ++i) {
    pacer.told(1'000'000, 1);
    pacer.drawn_all(0);
  }
  EXPECT_EQ(pacer.work(1), 1'000'000u);
  EXPECT_EQ(pacer.work(1, 1'250'000), 1'250'000u);
  EXPECT_EQ(pacer.work(1, 1'300'000), 1'000'000u);
  EXPECT_EQ(pacer.work(1, 10), 10u);
  EXPECT_EQ(PiecePacer(false).work(1, 10), 10u);
}

TEST(PiecePacer, SecondsCountForThePieceThatTookThem) {
  PiecePacer pacer(true);
  const std::uint64_t first = pacer.work(1);
  pacer.told(10000, 0.01);
  pacer.drawn_before_last(0);
  EXPECT_EQ(pacer.work(1), first) << "nothing is drawn yet";
  pacer.told(20000, 0.02);
  pacer.drawn_before_last(0.04);
  EXPECT_NEAR(static_cast<double>(pacer.work(1)), 10000 / 0.05, 1);
  // The last piece, a small one, is waited for together with the one before.
  pacer.told(100, 0.001);
  pacer.drawn_all(0.1);
  EXPECT_NEAR(static_cast<double>(pacer.work(1)), 20100 / 0.121, 1);
  // Nothing of it is left to be charged with.
  const std::uint64_t before = pacer.work(1);
  pacer.told(10000, 0.01);
  pacer.drawn_before_last(0.5);
  EXPECT_EQ(pacer.work(1), before);
}

TEST(PiecePacer, QuickPiecesAreBelievedOneByOne) {
  PiecePacer pacer(true);
  const std::uint64_t first = pacer.work(1);
  pacer.told(1000000, 1e-3);
  pacer.drawn_all(0);
  EXPECT_EQ(pacer.work(1), 2 * first);
}

TEST(PiecePacer, ADeviceIsQuickUntilAPieceWasMeasured) {
  PiecePacer pacer(false);
  EXPECT_EQ(pacer.work(1e-6), PiecePacer(false).work(1));
  pacer.told(50000, 0.25);
  pacer.drawn_all(0.25);
  EXPECT_EQ(pacer.work(1), 100000u);
}

/// Somebody who draws beside the thread that tells what; seconds for a unit of work.
struct Drawer {
  double telling, drawing;
  double now = 0, drawn_before = 0, drawn = 0;  ///< times

  double tell(std::uint64_t work) {
    const double seconds = telling * static_cast<double>(work);
    now += seconds;
    drawn_before = drawn;
    drawn = std::max(drawn, now) + drawing * static_cast<double>(work);
    return seconds;
  }
  double wait_until(double time) {
    const double before = now;
    now = std::max(now, time);
    return now - before;
  }
};

TEST(PiecePacer, PiecesThatLagByOneTakeAsLongAsAsked) {
  constexpr double kSeconds = 0.06, kTelling = 1e-6, kDrawing = 3e-6;
  PiecePacer pacer(true);
  Drawer drawer{kTelling, kDrawing};
  for (int picture = 0; picture < 20; ++picture) {
    for (std::uint64_t left = 201000 + 1000 * static_cast<std::uint64_t>(picture); left > 0;) {
      const std::uint64_t work = std::min(pacer.work(kSeconds), left);
      const double begin = drawer.now;
      left -= work;
      pacer.told(work, drawer.tell(work));
      if (left > 0)
        pacer.drawn_before_last(drawer.wait_until(drawer.drawn_before));
      else
        pacer.drawn_all(drawer.wait_until(drawer.drawn));
      if (picture < 2) continue;
      EXPECT_LT(drawer.now - begin, 2 * kSeconds) << picture << ' ' << left;
      // Neither the first piece of a picture, which is drawn beside the second, nor the small last
      // one says anything else of the next.
      EXPECT_NEAR(static_cast<double>(pacer.work(kSeconds)), kSeconds / kDrawing,
                  0.5 * kSeconds / kDrawing)
          << picture << ' ' << left;
    }
  }
}

}  // namespace
}  // namespace isobrick

#include "viewer/app/frame_pacer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

namespace isobrick::inline v0 {
namespace {

/// Simulates previews of a surface of `full` triangles; a million take `seconds_per_million`.
struct Previews {
  FramePacer& pacer;
  double full, pixels, seconds_per_million, occlusion = 0;
  double seconds = 0, triangles = 0;

  void draw() {
    const double s = pacer.size_divisor();
    triangles = std::min(full, static_cast<double>(pacer.max_triangles()));
    seconds = pixels / (s * s) + triangles / 1e6 * seconds_per_million +
              (pacer.reduces_quality() ? 0 : occlusion);
    pacer.add_preview(seconds, static_cast<std::uint64_t>(triangles), triangles < full);
  }
};

TEST(FramePacer, PreviewsUseTheWholeTime) {
  for (const double full : {6e5, 6e6})
    for (const double pixels : {0.0, 0.01}) {
      FramePacer pacer(0.05);
      pacer.add_still(pixels + full / 1e6 + 0.3, static_cast<std::uint64_t>(full));
      Previews previews{pacer, full, pixels, 1};
      for (int i = 0; i < 15; ++i) {
        previews.draw();
        EXPECT_LT(previews.seconds, 0.05) << full << ": from the first one on";
      }
      EXPECT_GE(previews.seconds, 0.0375) << full;
      EXPECT_EQ(pacer.size_divisor(), 1);
    }
}

TEST(FramePacer, PicturesThatAreQuickEnoughLoseNothing) {
  FramePacer pacer = FramePacer::for_device(true);
  EXPECT_TRUE(pacer.reduces_quality()) << "until one in full was quick";
  pacer.add_still(0.02, 600'000);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(pacer.max_triangles(), FramePacer::kAllTriangles);
    EXPECT_EQ(pacer.size_divisor(), 1);
    EXPECT_FALSE(pacer.reduces_quality());
    pacer.add_preview(0.03, 600'000, false);
  }
}

TEST(FramePacer, LeavesOcclusionOutBeforeDetail) {
  FramePacer pacer(0.05);
  pacer.add_preview(0.08, 100'000, false);
  EXPECT_TRUE(pacer.reduces_quality());
  EXPECT_EQ(pacer.max_triangles(), FramePacer::kAllTriangles);
  for (int i = 0; i < 5; ++i) pacer.add_preview(0.03, 100'000, false);
  EXPECT_TRUE(pacer.reduces_quality()) << "until a picture at rest leaves time for it";
  EXPECT_EQ(pacer.max_triangles(), FramePacer::kAllTriangles);
  pacer.add_still(0.04, 100'000);
  EXPECT_TRUE(pacer.reduces_quality()) << "a preview takes longer than that";
  pacer.add_still(0.03, 100'000);
  EXPECT_FALSE(pacer.reduces_quality());
}

TEST(FramePacer, HalvesTrianglesThatTakeTooLong) {
  FramePacer pacer = FramePacer::for_device(false);
  pacer.add_preview(0.1, 8'000'000, false);  // occlusion goes
  pacer.add_preview(0.1, 8'000'000, false);
  EXPECT_EQ(pacer.max_triangles(), 4'000'000u);
  pacer.add_preview(0.1, 3'000'000, true);
  EXPECT_EQ(pacer.max_triangles(), 1'500'000u);
  pacer.add_preview(0.012, 1'500'000, true);
  EXPECT_EQ(pacer.max_triangles(), 1'500'000u) << "as long as a frame may take";
}

TEST(FramePacer, SettlesWhereTrianglesTakeTheTime) {
  FramePacer pacer = FramePacer::for_device(false);
  Previews previews{pacer, 1e7, 0, 4e-3};
  for (int i = 0; i < 200; ++i) {
    previews.draw();
    EXPECT_EQ(pacer.size_divisor(), 1);
    if (i <= 20) continue;
    EXPECT_LE(previews.seconds, 0.0125);
    EXPECT_GE(previews.seconds, 0.75 * 0.0125);
  }
}

TEST(FramePacer, MakesPicturesSmallerWhereTheirPixelsTakeTheTime) {
  // As llvmpipe: 70 ms for the pixels at reduced quality, 60 ms more for the triangles.
  FramePacer pacer(0.05);
  Previews previews{pacer, 60'000, 0.07, 1, 0.2};
  for (int i = 0; i < 60; ++i) {
    previews.draw();
    if (i > 10) {
      EXPECT_LT(previews.seconds, 0.05);
    }
  }
  EXPECT_GT(pacer.size_divisor(), 1);
  EXPECT_LT(pacer.size_divisor(), 4);
  EXPECT_GT(previews.triangles, 20'000) << "there is time for them";
  for (int i = 0; i < 100; ++i) pacer.add_preview(0.002, 60'000, previews.triangles < 60'000);
  EXPECT_EQ(pacer.size_divisor(), 1);
}

TEST(FramePacer, LeavesAlmostNothingWhereAllTakesTooLong) {
  FramePacer pacer = FramePacer::for_device(true);
  for (int i = 0; i < 30; ++i)
    pacer.add_preview(2, std::min<std::uint64_t>(pacer.max_triangles(), 1e6), true);
  EXPECT_EQ(pacer.size_divisor(), 4);
  EXPECT_EQ(pacer.max_triangles(), 2'000u);
}

TEST(FramePacer, RefinesAgainWhereThereIsTime) {
  FramePacer pacer(0.05);
  Previews slow{pacer, 1e5, 0.2, 1};
  for (int i = 0; i < 10; ++i) slow.draw();
  EXPECT_LT(pacer.max_triangles(), 50'000u);
  EXPECT_GT(pacer.size_divisor(), 1);
  Previews quick{pacer, 1e5, 0, 0.04};
  for (int i = 0; i < 100; ++i) quick.draw();
  EXPECT_EQ(quick.triangles, 1e5);
  EXPECT_EQ(pacer.size_divisor(), 1);
}

/// Simulates previews of a surface whose thin structure needs 200,000 triangles; a million take
/// `seconds_per_million`.
struct ThinPreviews {
  FramePacer& pacer;
  double pixels, seconds_per_million;
  double seconds = 0;
  bool thin = false;

  void draw() {
    constexpr std::uint64_t kNeeded = 200'000;
    const double s = pacer.size_divisor();
    thin = pacer.thin_triangles() >= kNeeded && pacer.max_triangles() < kNeeded;
    const std::uint64_t most = std::max(pacer.max_triangles(), pacer.thin_triangles());
    const std::uint64_t triangles = std::min(thin ? kNeeded : pacer.max_triangles(), most);
    seconds = pixels / (s * s) + static_cast<double>(triangles) / 1e6 * seconds_per_million;
    pacer.add_preview(seconds, triangles, true, thin);
  }
};

TEST(FramePacer, ThePictureGivesWayBeforeThinStructure) {
  FramePacer pacer = FramePacer::for_device(true);
  ThinPreviews previews{pacer, 0.4, 0.6};
  previews.draw();
  EXPECT_GT(previews.seconds, 0.18);
  for (int i = 0; i < 30; ++i) {
    previews.draw();
    EXPECT_TRUE(previews.thin) << i;
    EXPECT_LE(previews.seconds, 0.18);
  }
  EXPECT_EQ(pacer.size_divisor(), 4);
  EXPECT_EQ(pacer.thin_triangles(), FramePacer::kThinTriangles);
}

TEST(FramePacer, ThinStructureTakesFourTimesTheLimitAtMost) {
  for (const double seconds_per_million : {0.5, 3.0, 10.0, 1000.0}) {
    FramePacer pacer(0.045);
    pacer.add_still(1, 20'000);
    ThinPreviews previews{pacer, 0.1, seconds_per_million};
    int long_ones = 0;
    for (int i = 0; i < 100; ++i) {
      previews.draw();
      long_ones += previews.thin && previews.seconds > 4 * 0.045;
    }
    EXPECT_LE(long_ones, 2) << seconds_per_million;
    EXPECT_EQ(previews.thin, seconds_per_million == 0.5) << "that much may be had in time";
    EXPECT_LT(previews.seconds,
              0.18 + 2e-3 * seconds_per_million);  // with the minimum of triangles
  }
}

TEST(FramePacer, ThinStructureComesBackWhereThereIsTime) {
  FramePacer pacer = FramePacer::for_device(true);
  ThinPreviews slow{pacer, 0.1, 5};
  for (int i = 0; i < 10; ++i) slow.draw();
  EXPECT_LT(pacer.thin_triangles(), 200'000u);
  ThinPreviews quick{pacer, 0.01, 0.02};
  for (int i = 0; i < 100; ++i) quick.draw();
  EXPECT_GE(std::max(pacer.thin_triangles(), pacer.max_triangles()), 200'000u);
  EXPECT_EQ(pacer.size_divisor(), 1);
}

}  // namespace
}  // namespace isobrick

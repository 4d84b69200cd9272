#include "viewer/app/isovalue_stats.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <numeric>
#include <thread>

#include "tests/pipeline/drop_histogram.h"
#include "tests/viewer/app/scene_renderer_fixture.h"

namespace isobrick::inline v0 {
namespace {

bool comes(const std::function<bool()>& holds) {
  for (int i = 0; i < 3000; ++i) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

class Statistics : public SceneRendererTest {
 protected:
  void make_store(Int3 extent) {
    NoProgress progress;
    convert(*make_synth({.kind = SynthKind::sphere, .extent = extent}), dir_ / "store.zarr",
            {.brick = 32}, progress);
  }
  std::shared_ptr<const StoreReader> store() {
    return std::make_shared<const StoreReader>(dir_ / "store.zarr");
  }
};

TEST_F(Statistics, LeaveOutBricksThatCannotBeRead) {
  make_store({96, 96, 96});
  IsovalueStats whole(store());
  EXPECT_TRUE(comes([&] { return whole.histogram() != nullptr; }));
  EXPECT_EQ(whole.take_failure(), "");
  damage_bricks();
  {
    const IsovalueStats kept(store());
    EXPECT_TRUE(comes([&] { return kept.histogram() != nullptr; })) << "it is kept";
  }
  test::drop_histogram(dir_ / "store.zarr");
  IsovalueStats damaged(store());
  std::string why;
  EXPECT_TRUE(comes([&] { return !(why = damaged.take_failure()).empty(); }));
  EXPECT_TRUE(contains(why, "store.zarr")) << why;
  EXPECT_TRUE(contains(why, "1 of level 0")) << why;
  ASSERT_NE(damaged.histogram(), nullptr);
  const auto count = [](const IsovalueStats& stats) {
    const auto& counts = stats.histogram()->counts;
    return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
  };
  EXPECT_EQ(count(whole), 96u * 96 * 96);
  EXPECT_LT(count(damaged), count(whole));
  EXPECT_GT(count(damaged), count(whole) / 2);
  EXPECT_EQ(damaged.take_failure(), "") << "once";
}

TEST_F(Statistics, ThereIsAlwaysAnEstimateOfTriangles) {
  make_store({48, 48, 48});  // of 27 blocks
  const IsovalueStats stats(store());
  const double iso = default_isovalue(ScalarType::u8);
  const auto blocks = static_cast<double>(stats.counts().active_blocks(iso));
  ASSERT_GT(blocks, 0);
  StreamCounters made;
  EXPECT_EQ(stats.triangles(iso, made), blocks * CutBudget().triangles_per_block);
  made.blocks_made = 1;  // less than there are
  made.triangles_made = 7;
  EXPECT_EQ(stats.triangles(iso, made), blocks * CutBudget().triangles_per_block);
  made.blocks_made = 100;
  made.triangles_made = 20'000;
  EXPECT_EQ(stats.triangles(iso, made), blocks * 200);
  made.triangles_per_block = 300;
  EXPECT_EQ(stats.triangles(iso, made), blocks * 300);
  EXPECT_EQ(stats.triangles(1e9, made), 0);
}

TEST_F(Statistics, AFewBlocksAreMeasured) {
  open(SynthKind::sphere, {48, 48, 48});
  settings_.pixel_error = 0.5f;  // the finest level
  draw();
  const IsovalueStats stats(store());
  const double iso = settings_.surfaces[0].isovalue;
  const double estimated = stats.triangles(iso, scene_renderer_->scene().stream().counters());
  const auto there = static_cast<double>(scene_renderer_->state().triangles);
  EXPECT_NEAR(estimated, there, 0.3 * there);
}

}  // namespace
}  // namespace isobrick

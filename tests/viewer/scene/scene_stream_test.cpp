#include "viewer/scene/scene_stream.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/drawable_checks.h"
#include "tests/viewer/scene/perspective.h"
#include "tests/viewer/scene/random_cut.h"
#include "tests/viewer/scene/test_device.h"

namespace isobrick::test {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::shared_ptr<MemoryBricks> make_source(Index n, Index brick = 32) {
  return std::make_shared<MemoryBricks>(Int3{n, n, n}, std::function<float(Int3)>([n](Int3 p) {
                                          return static_cast<float>(gyroid_ball(p, n));
                                        }),
                                        MemoryBricks::Options{.brick = brick});
}

TEST(SceneStream, CoversTheViewFromTheFirstMeshOnAndEndsWithTheCut) {
  const auto source = make_source(200);
  const auto tree = std::make_shared<const NodeTree>(*source);
  source->set_delay(milliseconds(2));
  SceneStream stream(source, tree, {.threads = 2});
  std::size_t versions_seen = 0;
  for (unsigned seed = 1; seed < 4; ++seed) {
    const Cut cut = RandomCut(tree->grid(), seed, 5).cut({0.0});
    const auto before = stream.drawable();
    stream.set_cut(cut);
    EXPECT_FALSE(stream.is_newest(*before));
    std::set<std::uint64_t> versions;
    bool begun = false;
    for (;;) {
      const bool idle = stream.idle();
      const auto drawable = stream.drawable();
      EXPECT_TRUE(!idle || stream.is_newest(*drawable));
      expect_no_overlap(tree->grid(), *drawable);
      versions.insert(drawable->version);
      if (begun) {
        EXPECT_TRUE(covers(*tree, *drawable, 0));
      }
      begun |= covers(*tree, *drawable, 0);
      if (idle) break;
      std::this_thread::sleep_for(milliseconds(1));
    }
    const auto last = stream.drawable();
    EXPECT_TRUE(last->complete);
    versions_seen += versions.size();
    for (const NodeDraw& drawn : last->nodes) {
      const auto in_cut = std::find_if(cut.nodes.begin(), cut.nodes.end(), [&](const CutNode& n) {
        return n.key == drawn.mesh->key && n.coarser == drawn.mesh->coarser;
      });
      EXPECT_NE(in_cut, cut.nodes.end());
    }
    EXPECT_EQ(stream.drawable(), last) << "the same until something changes";
  }
  // The last cut has few nodes; on a busy machine some are missed.
  EXPECT_GT(versions_seen, 9u);
}

TEST(SceneStream, CoarseNodesComeFirst) {
  const auto source = make_source(200);
  const auto tree = std::make_shared<const NodeTree>(*source);
  source->set_delay(milliseconds(1));
  SceneStream stream(source, tree, {.threads = 1});
  stream.set_cut(RandomCut(tree->grid(), 1, 100).cut({0.0}));
  int finest_seen = tree->grid().levels();
  while (!stream.idle()) {
    const auto drawable = stream.drawable();
    for (const NodeDraw& node : drawable->nodes)
      finest_seen = std::min(finest_seen, node.mesh->key.level);
    if (finest_seen == 0) break;
    const auto made = stream.counters().meshes_made;
    if (made == 1) {
      EXPECT_GE(finest_seen, tree->grid().coarsest_stored());
    }
  }
  stream.wait_idle(60);
  EXPECT_TRUE(stream.drawable()->complete);
}

TEST(SceneStream, WhatIsCutAwayIsNeitherReadNorMeshed) {
  const auto source = make_source(150);
  const auto tree = std::make_shared<const NodeTree>(*source);
  SceneStream stream(source, tree, {.threads = 2});
  Cut cut = RandomCut(tree->grid(), 2, 3).cut({0.0});
  for (CutNode& node : cut.nodes) {
    node.clipped = tree->grid().box(node.key).lo.x > 0;
    node.visible = !node.clipped;
  }
  stream.set_cut(cut);
  ASSERT_TRUE(stream.wait_idle(60));
  const auto drawn = stream.drawable();
  EXPECT_TRUE(drawn->complete);
  EXPECT_FALSE(drawn->nodes.empty());
  for (const NodeDraw& node : drawn->nodes) EXPECT_EQ(node.mesh->key.node.x, 0);
}

TEST(SceneStream, AnotherIsovalueNeedsNoBrickAgain) {
  const auto source = make_source(150);
  const auto tree = std::make_shared<const NodeTree>(*source);
  SceneStream stream(source, tree, {.threads = 2});
  Cut cut = RandomCut(tree->grid(), 2, 3).cut({0.0});
  stream.set_cut(cut);
  ASSERT_TRUE(stream.wait_idle(60));
  const auto reads = source->reads();
  const auto before = stream.drawable();
  cut.isovalues = {-0.5};
  stream.set_cut(cut);
  EXPECT_FALSE(stream.drawable()->nodes.empty()) << "the isovalue before stays until then";
  ASSERT_TRUE(stream.wait_idle(60));
  EXPECT_LE(source->reads(), reads + reads / 2);
  for (const NodeDraw& node : stream.drawable()->nodes) EXPECT_EQ(node.mesh->isovalue, -0.5);
  // The previous cut needs no work.
  const auto made = stream.counters().meshes_made;
  cut.isovalues = {0.0};
  stream.set_cut(cut);
  EXPECT_TRUE(stream.idle());
  EXPECT_EQ(stream.drawable()->triangles, before->triangles);
  EXPECT_EQ(stream.counters().meshes_made, made);
}

TEST(SceneStream, ShowsSeveralIsovaluesAtOnce) {
  const auto source = make_source(150);
  const auto tree = std::make_shared<const NodeTree>(*source);
  SceneStream stream(source, tree, {.threads = 2});
  stream.set_cut(RandomCut(tree->grid(), 2, 3).cut({-1.0, 0.0, 1.0}));
  ASSERT_TRUE(stream.wait_idle(60));
  const auto drawable = stream.drawable();
  EXPECT_TRUE(drawable->complete);
  std::set<int> numbers;
  for (const NodeDraw& node : drawable->nodes) {
    numbers.insert(node.isovalue);
    EXPECT_EQ(node.mesh->isovalue, node.isovalue - 1.0);
  }
  EXPECT_EQ(numbers.size(), 3u);
  expect_no_overlap(tree->grid(), *drawable);
}

TEST(SceneStream, ADamagedBrickMarksItsNodesAndTheRestGoesOn) {
  const auto source = make_source(150);
  const auto tree = std::make_shared<const NodeTree>(*source);
  source->damage(0, {2, 2, 1});
  SceneStream stream(source, tree, {.threads = 2});
  stream.set_cut(RandomCut(tree->grid(), 1, 100).cut({0.0}));
  ASSERT_TRUE(stream.wait_idle(60));
  const auto drawable = stream.drawable();
  int damaged = 0, whole = 0;
  for (const NodeDraw& node : drawable->nodes) {
    damaged += !node.mesh->damage.empty();
    whole += node.mesh->damage.empty();
    if (!node.mesh->damage.empty()) {
      EXPECT_NE(node.mesh->damage.find("damaged"), std::string::npos);
    }
  }
  EXPECT_GT(damaged, 0);
  EXPECT_GT(whole, 5);
  EXPECT_EQ(stream.counters().damaged, static_cast<std::uint64_t>(damaged));
  EXPECT_TRUE(drawable->complete);
}

/// Accepts some grids, then fails for all of them.
class FailingDevice final : public TestDevice {
 public:
  explicit FailingDevice(std::size_t taken = kTaken) : most_(taken) {}
  ~FailingDevice() override {
    for (std::thread& thread : threads_) thread.join();
  }
  bool make(const GridView& grid, NodeMesh mesh, Callback done) override {
    const std::lock_guard lock(mutex_);
    ++requested;
    stored += grid.stored.samples != nullptr;
    if (failed_) return false;
    taken_.emplace_back(std::move(mesh), std::move(done));
    if (taken_.size() < most_) return true;
    failed_ = true;
    threads_.emplace_back([taken = std::exchange(taken_, {})]() mutable {
      for (auto& [of, reply] : taken) reply(std::move(of), "broken");
    });
    return true;
  }
  std::string failure() const override {
    const std::lock_guard lock(mutex_);
    return failed_ ? "broken" : "";
  }

  static constexpr std::size_t kTaken = 3;
  std::atomic<std::size_t> requested = 0, stored = 0;

 private:
  std::size_t most_;
  mutable std::mutex mutex_;
  bool failed_ = false;
  std::vector<std::pair<NodeMesh, Callback>> taken_;
  std::vector<std::thread> threads_;
};

TEST(SceneStream, WhatADeviceFailsToMakeIsMadeWithoutIt) {
  const auto source = make_source(200);
  const auto tree = std::make_shared<const NodeTree>(*source);
  const Cut cut = RandomCut(tree->grid(), 1, 5).cut({0.0});
  FailingDevice device;
  const std::shared_ptr<DeviceMesher> shared(&device, [](DeviceMesher*) {});
  // The second stream gets a device that has failed.
  for (const bool first : {true, false}) {
    SceneStream stream(source, tree, {.threads = 4});
    stream.set_device(shared);
    EXPECT_EQ(stream.counters().device_failure, first ? "" : "broken");
    stream.set_cut(cut);
    ASSERT_TRUE(stream.wait_idle(60));
    const auto drawable = stream.drawable();
    EXPECT_TRUE(drawable->complete);
    EXPECT_TRUE(covers(*tree, *drawable, 0));
    EXPECT_EQ(stream.counters().device_failure, "broken");
    EXPECT_EQ(stream.counters().device_meshes_made, 0u);
    if (first) {
      EXPECT_GE(device.requested.exchange(0), FailingDevice::kTaken);
    }
  }
  EXPECT_EQ(device.requested, 0u) << "no request in vain";
}

/// Only a device receives stored samples.
TEST(SceneStream, WhatADeviceFailsToMakeOfStoredSamplesIsMadeWithoutIt) {
  constexpr Index n = 200;
  const auto source = std::make_shared<MemoryBricks>(
      Int3{n, n, n}, std::function<std::uint8_t(Int3)>([](Int3 p) {
        return static_cast<std::uint8_t>(std::clamp(128 + 60 * gyroid_ball(p, n), 0.0, 255.0));
      }),
      MemoryBricks::Options{.brick = 32});
  const auto tree = std::make_shared<const NodeTree>(*source);
  const Cut cut = RandomCut(tree->grid(), 1, 100).cut({127.5});
  FailingDevice device(12);  // includes some of the finest level
  SceneStream stream(source, tree, {.threads = 4}), without(source, tree, {.threads = 4});
  stream.set_device(std::shared_ptr<DeviceMesher>(&device, [](DeviceMesher*) {}));
  for (SceneStream* s : {&stream, &without}) {
    s->set_cut(cut);
    ASSERT_TRUE(s->wait_idle(60));
  }
  EXPECT_EQ(stream.counters().device_failure, "broken");
  EXPECT_GT(device.stored, 0u);
  const auto drawable = stream.drawable(), expected = without.drawable();
  EXPECT_TRUE(drawable->complete);
  ASSERT_EQ(drawable->nodes.size(), expected->nodes.size());
  EXPECT_EQ(drawable->triangles, expected->triangles);
  EXPECT_GT(drawable->triangles, 1000u);
}

TEST(SceneStream, WhatAStraightPlanIsLateWithBringsTheLevelsBetween) {
  const auto source = make_source(200);
  const auto tree = std::make_shared<const NodeTree>(*source);
  source->set_delay(milliseconds(20));
  SceneStream stream(source, tree, {.threads = 4});
  stream.set_cut(RandomCut(tree->grid(), 1, 100).cut({0.0}));
  const StreamCounters first = stream.counters();
  const std::uint64_t planned = first.queue + first.working + first.meshes_made;
  std::set<int> levels;
  for (bool idle = false; !idle;) {
    idle = stream.wait_idle(0.002);
    for (const NodeDraw& node : stream.drawable()->nodes) levels.insert(node.mesh->key.level);
  }
  EXPECT_TRUE(stream.drawable()->complete);
  EXPECT_GT(stream.counters().meshes_made, planned);
  EXPECT_TRUE(std::any_of(levels.begin(), levels.end(), [&](int level) {
    return level > 0 && level < tree->grid().coarsest_stored();
  }));
}

TEST(SceneStream, EndsAtOnceWhateverIsGoingOn) {
  const auto source = make_source(150, 16);
  const auto tree = std::make_shared<const NodeTree>(*source);
  for (const int delay : {20, 2000}) {
    source->set_delay(milliseconds(delay));
    auto stream = std::make_unique<SceneStream>(source, tree, StreamOptions{.threads = 4});
    Cut cut = RandomCut(tree->grid(), 1, 10).cut({0.0});
    stream->set_cut(cut);
    std::this_thread::sleep_for(milliseconds(60));
    for (const double isovalue : {0.1, 0.2, 0.3}) {
      cut.isovalues = {isovalue};
      const auto start = Clock::now();
      stream->set_cut(cut);
      EXPECT_LT(seconds_since(start), 0.1);
      const auto drawing = Clock::now();
      (void)stream->drawable();
      EXPECT_LT(seconds_since(drawing), 0.1);
    }
    const auto start = Clock::now();
    stream.reset();
    EXPECT_LT(seconds_since(start), 0.1) << "reads of " << delay << " ms";
  }
}

TEST(SceneStream, KeepsBricksAndMeshesWithinTheirBudgets) {
  const Index n = 256;
  const auto source = make_source(n, 16);
  const auto tree = std::make_shared<const NodeTree>(*source);
  const std::uint64_t volume_bytes = static_cast<std::uint64_t>(n * n * n) * 4;
  StreamOptions options{.threads = 2, .brick_bytes = volume_bytes / 8, .mesh_bytes = 4 << 20};
  SceneStream stream(source, tree, options);
  std::uint64_t most_meshes = 0;
  for (unsigned seed = 1; seed < 5; ++seed) {
    stream.set_cut(RandomCut(tree->grid(), seed, 4).cut({0.0}));
    while (!stream.wait_idle(0.005)) {
      (void)stream.drawable();
      most_meshes = std::max(most_meshes, stream.counters().mesh_bytes);
    }
    EXPECT_TRUE(covers(*tree, *stream.drawable(), 0));
  }
  EXPECT_LE(stream.counters().brick_bytes_peak, options.brick_bytes);
  EXPECT_GT(stream.counters().brick_bytes_peak, options.brick_bytes / 2);
  // Each thread may add one mesh.
  EXPECT_LE(most_meshes, options.mesh_bytes + 2 * (2 << 20));
}

}  // namespace
}  // namespace isobrick::test

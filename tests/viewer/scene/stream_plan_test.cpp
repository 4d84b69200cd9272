#include "viewer/scene/stream_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/blocking_source.h"
#include "tests/viewer/scene/forwarding_source.h"
#include "tests/viewer/scene/random_cut.h"

namespace isobrick::test {
namespace {

class PlanTest : public testing::Test {
 protected:
  MeshPlan plan(double max_meshes) { return plan_jobs(tree_, cut_, meshes_, mesher_, max_meshes); }
  /// Number of jobs for nodes that are not in the cut.
  std::size_t ancestors(const MeshPlan& plan, bool coarsest_only) const {
    std::size_t count = 0;
    for (const MeshJob& job : plan.jobs) {
      const bool in_cut = std::any_of(cut_.nodes.begin(), cut_.nodes.end(),
                                      [&](const CutNode& node) { return node.key == job.key; });
      count += !in_cut && (!coarsest_only || job.key.level == tree_.grid().coarsest_stored());
      EXPECT_LE(job.key.level, tree_.grid().coarsest_stored());
    }
    return count;
  }
  void make(const MeshJob& job) {
    auto mesh = std::make_shared<NodeMesh>();
    mesh->key = job.key;
    mesh->isovalue = job.isovalue;
    mesh->coarser = job.coarser;
    meshes_.put(std::move(mesh));
  }

  std::shared_ptr<MemoryBricks> source_ = std::make_shared<MemoryBricks>(
      Int3{200, 200, 200},
      std::function<float(Int3)>([](Int3 p) { return static_cast<float>(gyroid_ball(p, 200)); }),
      MemoryBricks::Options{});
  NodeTree tree_{*source_};
  ResidentBricks bricks_{source_, 100 << 20};
  NodeMesher mesher_{tree_.grid(), bricks_, {0, 0, 0}};
  MeshCache meshes_{100 << 20, 0};
  Cut cut_ = RandomCut(tree_.grid(), 1, 100).cut({0.0});
};

TEST_F(PlanTest, WhatComesSoonBringsTheCoarsestLevelAlone) {
  ASSERT_GT(tree_.grid().coarsest_stored(), 1);
  ASSERT_GT(tree_.grid().levels(), tree_.grid().coarsest_stored() + 1);
  const MeshPlan slow = plan(0), quick = plan(1e6);
  EXPECT_FALSE(slow.skips_levels);
  EXPECT_TRUE(quick.skips_levels);
  EXPECT_GT(ancestors(slow, false), ancestors(slow, true));
  EXPECT_EQ(ancestors(quick, false), ancestors(quick, true));
  EXPECT_EQ(ancestors(quick, true), ancestors(slow, true));
  EXPECT_GT(ancestors(quick, true), 0u);
  EXPECT_EQ(quick.jobs.size() - ancestors(quick, false), slow.jobs.size() - ancestors(slow, false));
  EXPECT_EQ(quick.jobs.front().key.level, tree_.grid().coarsest_stored()) << "that one first";
}

TEST_F(PlanTest, WhereMostIsThereAllLevelsStandIn) {
  const MeshPlan all = plan(1e6);
  std::size_t left = 3;
  for (const MeshJob& job : all.jobs)
    if (job.key.level < tree_.grid().coarsest_stored() && (left == 0 || --left == 0)) make(job);
  const MeshPlan rest = plan(1e6);
  EXPECT_FALSE(rest.skips_levels);
  EXPECT_LT(rest.jobs.size(), all.jobs.size());
  EXPECT_GT(ancestors(rest, false), ancestors(rest, true));
}

TEST_F(PlanTest, WhatStandsInForAnythingVisibleIsVisible) {
  for (std::size_t i = 0; i < cut_.nodes.size(); ++i) cut_.nodes[i].visible = i % 7 == 5;
  std::size_t hidden = 0, visible = 0;
  for (const MeshJob& job : plan(0).jobs) {
    bool any = false, in_cut = false;
    for (const CutNode& node : cut_.nodes) {
      in_cut |= node.key == job.key;
      if (!node.visible || !tree_.may_hold_surface(node.key, 0, node.coarser)) continue;
      NodeKey n = node.key;
      while (n.level < job.key.level) n = tree_.grid().parent(n);
      any |= n == job.key;
    }
    if (in_cut) continue;
    EXPECT_EQ(job.visible, any);
    ++(any ? visible : hidden);
  }
  EXPECT_GT(visible, 0u);
  EXPECT_GT(hidden, 0u);
}

TEST_F(PlanTest, NothingIsMadeAboveAMeshThatStandsIn) {
  ASSERT_GT(tree_.grid().coarsest_stored(), 1);
  std::erase_if(cut_.nodes, [](const CutNode& node) { return node.key.level > 0; });
  std::vector<NodeKey> parents;
  for (const CutNode& node : cut_.nodes) {
    const NodeKey parent = tree_.grid().parent(node.key);
    if (std::find(parents.begin(), parents.end(), parent) == parents.end())
      parents.push_back(parent);
  }
  ASSERT_GT(ancestors(plan(0), false), 0u);
  for (const NodeKey& parent : parents) make({.key = parent, .isovalue = 0.0});
  for (const std::size_t each : {1u, 2u, 3u}) {
    for (std::size_t i = 0; i < cut_.nodes.size(); ++i)
      cut_.nodes[i].visible = i % each == each - 1;
    EXPECT_EQ(ancestors(plan(0), false), 0u) << each;
  }
}

TEST_F(PlanTest, LevelsThatAreNotStoredAreMadeWhereACutAsksForThem) {
  cut_ = RandomCut(tree_.grid(), 1, 0).cut({0.0});
  const MeshPlan plan = plan_jobs(tree_, cut_, meshes_, mesher_, 0);
  ASSERT_EQ(plan.jobs.size(), 1u);
  EXPECT_FALSE(tree_.grid().has_parent(plan.jobs.front().key));
  EXPECT_GT(plan.jobs.front().key.level, tree_.grid().coarsest_stored());
}

TEST(Plan, ANodeIsThereWhenHalfOfWhatItsMeshNeedsIs) {
  const auto source = std::make_shared<MemoryBricks>(
      Int3{128, 128, 128}, std::function<std::int16_t(Int3)>([](Int3 p) {
        const auto d = [](Index i) { return static_cast<double>(i) - 24; };
        return static_cast<std::int16_t>(100 * (6 - std::hypot(d(p.x), d(p.y), d(p.z))));
      }),
      MemoryBricks::Options{.brick = 16});
  const NodeTree tree(*source);
  ResidentBricks bricks(source, 100 << 20);
  NodeMesher mesher(tree.grid(), bricks, {0, 0, 0});
  MeshCache meshes(100 << 20, 0);
  Cut cut;
  cut.isovalues = {0.0};
  cut.nodes.push_back({.key = {0, {0, 0, 0}}});
  const auto resident = [&] {
    const MeshPlan plan = plan_jobs(tree, cut, meshes, mesher, 1e6);
    const auto job = std::find_if(plan.jobs.begin(), plan.jobs.end(),
                                  [&](const MeshJob& j) { return j.key == cut.nodes.front().key; });
    return job != plan.jobs.end() && job->resident;
  };
  // The bricks around the ball, a small part of the node's 5³.
  for_each_point({{0, 0, 0}, {3, 3, 3}}, [&](Int3 b) { (void)bricks.get(0, b, Always()); });
  EXPECT_FALSE(resident()) << "no ranges have been read: all might be needed";
  EXPECT_EQ(bricks.known_block_ranges(0, {0, 0, 0}), nullptr);
  ASSERT_GT(mesher.mesh(cut.nodes.front().key, 0, 0, Always()).mesh.triangles.size(), 0u);
  EXPECT_LE(bricks.counters().reads, 27u);
  EXPECT_NE(bricks.known_block_ranges(0, {0, 0, 0}), nullptr);
  EXPECT_TRUE(resident());
  bricks.close();
  EXPECT_FALSE(resident());
}

TEST(ResidentBricks, WhatAnotherThreadReadsIsBusy) {
  const auto memory = std::make_shared<MemoryBricks>(
      Int3{40, 40, 40}, std::function<float(Int3)>([](Int3 p) { return static_cast<float>(p.x); }),
      MemoryBricks::Options{});
  const auto source = std::make_shared<BlockingSource>(memory);
  ResidentBricks bricks(source, 10 << 20);
  std::shared_ptr<const BrickSamples> read;
  std::thread reader([&] { read = bricks.get(0, {1, 0, 0}, Always()); });
  source->wait_until_read();
  EXPECT_EQ(bricks.get_unless_busy(0, {1, 0, 0}, Always()), nullptr);
  source->open();
  reader.join();
  EXPECT_EQ(bricks.get_unless_busy(0, {1, 0, 0}, Always()), read);
  EXPECT_NE(bricks.get_unless_busy(0, {0, 0, 0}, Always()), nullptr) << "read by this thread";
  EXPECT_EQ(bricks.counters().reads, 2u);
}

TEST(ResidentBricks, ThreadsReadTogetherWhatAnyOfThemWants) {
  const auto source = std::make_shared<MemoryBricks>(
      Int3{128, 128, 128},
      std::function<float(Int3)>([](Int3 p) { return static_cast<float>(p.x); }),
      MemoryBricks::Options{});
  source->damage(0, {1, 1, 1});
  source->set_delay(std::chrono::milliseconds(20));
  ResidentBricks bricks(source, 100 << 20);
  std::vector<Int3> many, one{{0, 0, 3}, {1, 0, 3}};
  for_each_point({{0, 0, 0}, {4, 4, 2}}, [&](Int3 b) { many.push_back(b); });
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back([&, i] { bricks.read_together(0, i == 7 ? one : many, Always()); });
  for (std::thread& thread : threads) thread.join();
  // Read one after the other, they would take 0.68 s.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(500));
  EXPECT_EQ(bricks.counters().reads, many.size() + one.size()) << "each once";
  for (const Int3 b : many) {
    if (b == Int3{1, 1, 1}) {
      EXPECT_THROW((void)bricks.get(0, b, Always()), DamageError);
    } else {
      EXPECT_NE(bricks.find(0, b), nullptr);
    }
  }
  class AlwaysCancelled final : public CancellationToken {
   public:
    void check() const override { throw OperationCancelled(); }
  };
  const std::vector<Int3> others{{0, 1, 3}, {1, 1, 3}};
  EXPECT_THROW(bricks.read_together(0, others, AlwaysCancelled()), OperationCancelled);
  bricks.read_together(0, one, Always());
  EXPECT_EQ(bricks.find(0, others[0]), nullptr) << "nobody wants it any more";
}

/// A source whose brick `held` is read only after brick `first`.
class OrderedSource final : public ForwardingSource {
 public:
  OrderedSource(std::shared_ptr<const BrickSource> from, Int3 held, Int3 first)
      : ForwardingSource(std::move(from)), held_(held), first_(first) {}
  bool read_brick(int level, Int3 brick, std::byte* samples) const override {
    std::unique_lock lock(mutex_);
    if (brick == first_) {
      read_ = true;
      change_.notify_all();
    } else if (brick == held_) {
      change_.wait_for(lock, std::chrono::seconds(10), [&] { return read_; });
    }
    return from_->read_brick(level, brick, samples);
  }

 private:
  Int3 held_, first_;
  mutable std::mutex mutex_;
  mutable std::condition_variable change_;
  mutable bool read_ = false;
};

TEST(ResidentBricks, WhoWouldWaitReadsWhatIsWantedSoon) {
  const auto memory = std::make_shared<MemoryBricks>(
      Int3{128, 128, 128},
      std::function<float(Int3)>([](Int3 p) { return static_cast<float>(p.x); }),
      MemoryBricks::Options{});
  const Int3 held{1, 0, 0}, soon{3, 0, 0}, forgotten{3, 1, 0};
  ResidentBricks bricks(std::make_shared<OrderedSource>(memory, held, soon), 100 << 20);
  bricks.will_need(0, forgotten);
  bricks.forget_needs();
  bricks.will_need(0, soon);
  const std::vector<Int3> now{{0, 0, 0}, held, {2, 0, 0}};
  const auto start = std::chrono::steady_clock::now();
  std::thread other([&] { bricks.read_together(0, now, Always()); });
  bricks.read_together(0, now, Always());
  other.join();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
  EXPECT_NE(bricks.find(0, soon), nullptr);
  EXPECT_EQ(bricks.find(0, forgotten), nullptr);
  EXPECT_EQ(bricks.counters().reads, 4u);
}

}  // namespace
}  // namespace isobrick::test

#include "viewer/scene/node_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/perspective.h"
#include "viewer/scene/scene.h"

namespace isobrick::test {
namespace {

constexpr std::uint64_t kPlenty = 64 << 20;

template <class T>
std::shared_ptr<const MemoryBricks> waves(Int3 extent, double scale, double middle) {
  return std::make_shared<const MemoryBricks>(
      extent, std::function<T(Int3)>([=](Int3 p) {
        const double x = static_cast<double>(p.x), y = static_cast<double>(p.y),
                     z = static_cast<double>(p.z);
        if (p.x > 200 && p.y > 70) return static_cast<T>(0);  // nodes that nothing crosses
        return static_cast<T>(middle + scale * std::sin(x / 37) * std::cos(y / 61) +
                              scale * z / 700);
      }),
      MemoryBricks::Options{.brick = 64});
}

std::vector<std::vector<double>> queries(const NodeTree& tree) {
  const int top = tree.grid().levels() - 1;
  const ValueRange<float> all = tree.range_below({top, {0, 0, 0}});
  std::vector<std::vector<double>> queries{
      {}, {0.0}, {std::numeric_limits<double>::quiet_NaN()}, {all.lo}, {all.hi}, {all.hi + 1.0}};
  for (int i = 1; i < 8; ++i) {
    const double iso = all.lo + (static_cast<double>(all.hi) - all.lo) * i / 8;
    queries.push_back({iso});
    queries.push_back({iso, std::floor(iso), iso / 3});
  }
  return queries;
}

class IndexKinds : public testing::TestWithParam<IndexKind> {
 protected:
  /// Compares the result with each node's range.
  void expect_right(const std::shared_ptr<const MemoryBricks>& source) {
    const auto tree = std::make_shared<const NodeTree>(*source);
    NodeSearch search(tree, source->info().type, kPlenty, {});
    search.use(GetParam());
    search.wait();
    ASSERT_EQ(search.state().kind, GetParam());
    EXPECT_EQ(search.state().refused, "");
    EXPECT_GT(search.state().bytes, 0u);
    for (const auto& isovalues : queries(*tree)) {
      const ActiveNodes& active = search.find(isovalues);
      std::uint64_t count = 0;
      for (int v = 0; v < tree->grid().levels(); ++v)
        for_each_point({{0, 0, 0}, tree->grid().level(v).nodes}, [&](Int3 p) {
          bool expected = false;
          for (const double iso : isovalues) expected |= any_below(*tree, {v, p}, iso);
          EXPECT_EQ(active.below({v, p}), expected);
          count += v == 0 && expected;
        });
      EXPECT_EQ(active.count(), count);
      EXPECT_EQ(search.state().active, count);
    }
  }

  static bool any_below(const NodeTree& tree, const NodeKey& n, double iso) {
    if (tree.active(n, iso)) return true;
    bool any = false;
    if (n.level > 0)
      for_each_point(tree.grid().children(n), [&](Int3 c) {
        const NodeKey child{n.level - 1, c};
        any |= child.level > 0 ? finest_below(tree, child, iso) : tree.active(child, iso);
      });
    return any;
  }
  static bool finest_below(const NodeTree& tree, const NodeKey& n, double iso) {
    bool any = false;
    for_each_point(tree.grid().children(n), [&](Int3 c) {
      const NodeKey child{n.level - 1, c};
      any |= child.level > 0 ? finest_below(tree, child, iso) : tree.active(child, iso);
    });
    return any;
  }
};

TEST_P(IndexKinds, FindWhatEachNodesRangeSays) {
  expect_right(waves<std::uint8_t>({330, 150, 200}, 60, 120));
  expect_right(waves<std::int16_t>({200, 260, 70}, 9000, -500));
  expect_right(waves<float>({330, 150, 200}, 0.37, 0.001));
  expect_right(waves<double>({140, 150, 60}, 1e-3, 1));     // finer than floats
  expect_right(waves<std::uint8_t>({20, 9, 30}, 60, 120));  // one node
}

TEST_P(IndexKinds, MakeTheSameCuts) {
  const auto source = waves<std::uint8_t>({330, 150, 200}, 60, 120);
  Scene plain(source, {.threads = 1}), other(source, {.threads = 1});
  other.search().use(GetParam());
  other.search().wait();
  View view;
  view.eye = {400, -200, 300};
  view.width = 800;
  view.height = 600;
  view.pixel_error = 1;
  view.view_projection =
      perspective_view(view.eye, {160, 70, 100}, {0, 0, 1}, 0.8, 800.0 / 600, 1, 10000);
  for (const double iso : {90.0, 120.0, 170.0, 250.0}) {
    plain.update({iso}, view, {});
    other.update({iso}, view, {});
    ASSERT_EQ(plain.cut().nodes.size(), other.cut().nodes.size());
    for (std::size_t i = 0; i < plain.cut().nodes.size(); ++i) {
      EXPECT_EQ(plain.cut().nodes[i].key, other.cut().nodes[i].key);
      EXPECT_EQ(plain.cut().nodes[i].coarser, other.cut().nodes[i].coarser);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, IndexKinds, testing::ValuesIn(kIndexKinds),
                         [](const auto& kind) { return std::string(name_of(kind.param)); });

TEST(NodeSearch, GoesOnAnsweringWhileItIsSwitched) {
  const auto source = waves<float>({330, 150, 200}, 0.37, 0.001);
  const auto tree = std::make_shared<const NodeTree>(*source);
  std::atomic<int> changes = 0;
  NodeSearch search(tree, ScalarType::f32, kPlenty, [&] { ++changes; });
  EXPECT_EQ(search.state().kind, IndexKind::linear);
  const auto count = search.find(std::vector<double>{0.1}).count();
  EXPECT_GT(count, 0u);
  for (int i = 0; i < 50; ++i) {
    search.use(kIndexKinds[i % 5]);
    EXPECT_EQ(search.find(std::vector<double>{0.1}).count(), count);
  }
  search.use(IndexKind::quadtree);
  search.wait();
  // A request that is replaced while it is built does not take effect later.
  for (int i = 0; i < 20; ++i) {
    search.use(IndexKind::kdtree);
    std::this_thread::sleep_for(std::chrono::microseconds(20 * i));
    const IndexKind there = search.state().kind;
    search.use(there);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_EQ(search.state().kind, there);
    search.use(IndexKind::quadtree);
    search.wait();
  }
  EXPECT_EQ(search.state().kind, IndexKind::quadtree);
  EXPECT_FALSE(search.state().building);
  EXPECT_EQ(search.find(std::vector<double>{0.1}).count(), count);
}

TEST(NodeSearch, RefusesWhatDoesNotFit) {
  const auto source = waves<float>({330, 150, 200}, 0.37, 0.001);
  const auto tree = std::make_shared<const NodeTree>(*source);
  NodeSearch search(tree, ScalarType::f32, 2000, {});
  search.use(IndexKind::kdtree);
  search.wait();
  EXPECT_EQ(search.state().kind, IndexKind::linear);
  EXPECT_NE(search.state().refused.find("kdtree"), std::string::npos);
  EXPECT_NE(search.state().refused.find("of 2.0 KiB"), std::string::npos) << search.state().refused;
  search.use(IndexKind::linear);
  search.wait();
  EXPECT_EQ(search.state().refused, "");
}

TEST(NodeSearch, ItsMemoryIsTakenFromThatOfBricks) {
  for (const Int3 extent : {Int3{330, 150, 200}, Int3{40, 40, 40}}) {
    const auto source = waves<float>(extent, 0.37, 0.001);
    const auto tree = std::make_shared<const NodeTree>(*source);
    const auto nodes = static_cast<std::uint64_t>(volume(tree->grid().level(0).nodes));
    NodeSearch search(tree, ScalarType::f32, NodeSearch::building_bytes(nodes), {});
    for (const IndexKind kind : kIndexKinds) {
      search.use(kind);
      search.wait();
      EXPECT_EQ(search.state().kind, kind) << search.state().refused;
    }
  }
}

}  // namespace
}  // namespace isobrick::test

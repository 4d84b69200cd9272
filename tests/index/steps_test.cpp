#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "index/leaf_ranges.h"
#include "index/span_index.h"
#include "range_sets.h"

// The work of queries, counted, against the theory's bounds, as the number of
// items grows to 10⁷.

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kSizes[] = {1'000, 30'000, 1'000'000, 10'000'000};

/// Ranges of random width up to `width` of the values.
std::vector<ValueRange<float>> random_ranges(std::size_t n, double width) {
  Dice dice(11);
  std::vector<ValueRange<float>> ranges(n);
  for (auto& range : ranges) {
    const double at = dice.unit();
    range = range_at<float>(at, std::min(1.0, at + width * dice.unit()));
  }
  return ranges;
}

double logarithm(std::size_t n) { return std::log2(static_cast<double>(n)); }

/// Calls check(steps) at isovalues all over the values.
void for_isovalues(const IndexView& index, const std::function<void(const QuerySteps&)>& check) {
  for (double iso = -1010; iso < 1010; iso += 13.7) check(count_steps(index, iso));
}

TEST(Steps, OfIntervalTreesAreLogarithmicAndOneForEachAnswer) {
  for (const std::size_t n : kSizes)
    for (const double width : {1e-7, 1e-3, 1.0}) {
      if (n == 10'000'000 && width != 1e-3) continue;
      const auto bytes = build_index<float>(IndexKind::interval, random_ranges(n, width),
                                            {static_cast<Index>(n), 1, 1});
      for_isovalues(view_index(bytes), [&](const QuerySteps& steps) {
        EXPECT_EQ(steps.tested, 0u);
        EXPECT_LE(steps.runs, logarithm(n) + 1);
        // A node costs one step and finding k of its items 2·log₂(k + 1) more, which is below 2·k.
        EXPECT_LE(static_cast<double>(steps.nodes),
                  2 * (logarithm(n) + 1) + 2 * static_cast<double>(steps.answers));
      });
    }
}

TEST(Steps, OfKdTreesAreTheSquareRootAndOneForEachRun) {
  for (const std::size_t n : kSizes)
    for (const double width : {1e-3, 1.0}) {
      if (n == 10'000'000 && width != 1.0) continue;
      const auto bytes = build_index<float>(IndexKind::kdtree, random_ranges(n, width),
                                            {static_cast<Index>(n), 1, 1});
      for_isovalues(view_index(bytes), [&](const QuerySteps& steps) {
        // Independent of the number of answers: whole parts are runs.
        EXPECT_LE(static_cast<double>(steps.nodes + steps.tested),
                  16 * std::sqrt(static_cast<double>(n)))
            << n << " " << width << " " << steps.nodes << " " << steps.tested;
      });
    }
}

/// A continuous field, as volumes have: neighbours' ranges overlap.
template <class T>
std::vector<ValueRange<T>> cells_of_a_field(Index edge) {
  std::vector<T> samples;
  const double scale = 1 / static_cast<double>(edge);
  for_each_point({{0, 0, 0}, {edge + 1, edge + 1, edge + 1}}, [&](Int3 p) {
    const double x = static_cast<double>(p.x) * scale - 0.4,
                 y = static_cast<double>(p.y) * scale - 0.5,
                 z = static_cast<double>(p.z) * scale - 0.6;
    samples.push_back(static_cast<T>(200 * (x * x + y * y + z * z) + 20 * x * y));
  });
  std::vector<ValueRange<T>> ranges;
  leaf_ranges(SampleBlock<T>::dense(samples.data(), {edge + 1, edge + 1, edge + 1}), 1, ranges);
  return ranges;
}

constexpr Index kEdges[] = {10, 31, 100, 216};

TEST(Steps, OfOctreesAreTheAnswersTimesTheirDepthBelowTheForest) {
  for (const Index edge : kEdges) {
    const auto bytes =
        build_index<float>(IndexKind::octree, cells_of_a_field<float>(edge), {edge, edge, edge});
    const IndexView index = view_index(bytes);
    for (double iso = 0; iso < 250; iso += 3.3) {
      const QuerySteps steps = count_steps(index, iso);
      const auto n = static_cast<double>(index.items()), k = static_cast<double>(steps.answers);
      // Each stabbed node shows its eight children; of a level at most k or all are stabbed.
      const double levels = k > 0 ? std::log2(std::max(1.0, n / k)) / 3 + 3 : 0;
      EXPECT_LE(static_cast<double>(steps.nodes + steps.tested), 8 * k * levels + 9) << edge;
    }
  }
}

TEST(Steps, OfQuadtreesDependOnTheValuesAndNotOnTheItems) {
  for (const Index edge : kEdges) {
    const auto bytes = build_index<std::uint8_t>(
        IndexKind::quadtree, cells_of_a_field<std::uint8_t>(edge), {edge, edge, edge});
    const IndexView index = view_index(bytes);
    for (double iso = 0; iso < 250; iso += 3.3) {
      const QuerySteps steps = count_steps(index, iso);
      EXPECT_LE(steps.nodes + steps.tested, 4 * 256u) << edge;
    }
  }
}

}  // namespace
}  // namespace isobrick

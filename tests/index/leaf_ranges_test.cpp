#include "index/leaf_ranges.h"

#include <gtest/gtest.h>

#include <algorithm>

#include <isobrick/error.h>
#include "index/span_index.h"
#include "range_sets.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
std::vector<T> random_samples(Int3 extent, std::uint32_t seed) {
  Dice dice(seed);
  std::vector<T> samples(static_cast<std::size_t>(volume(extent)));
  for (T& v : samples) {
    v = value_at<T>(dice.unit());
    if constexpr (std::is_floating_point_v<T>) {
      using Limits = std::numeric_limits<T>;
      const T special[] = {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), -T(0)};
      if (dice.below(5) == 0) v = special[dice.below(40) < 37 ? 0 : 1 + dice.below(3)];
    }
  }
  return samples;
}

/// From the definition: all samples that the block's cells touch.
template <class T>
ValueRange<T> range_of_block(const SampleBlock<T>& samples, Int3 block, Index leaf) {
  const Int3 lo = block * leaf,
             hi = min((block + Int3{1, 1, 1}) * leaf + Int3{1, 1, 1}, samples.extent);
  ValueRange<T> range;
  for_each_point({lo, hi}, [&](Int3 p) {
    range.include(samples.data[p.z * samples.plane_stride + p.y * samples.row_stride + p.x]);
  });
  return range;
}

template <class T>
class LeafRanges : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(LeafRanges, SampleTypes);

TYPED_TEST(LeafRanges, CoverTheSamplesOfTheirCells) {
  using T = TypeParam;
  for (const Int3 extent : {Int3{17, 17, 17}, Int3{33, 18, 9}, Int3{2, 2, 2}, Int3{40, 5, 3},
                            Int3{16, 16, 16}, Int3{65, 3, 34}}) {
    const std::vector<T> data = random_samples<T>(extent, 1);
    const auto samples = SampleBlock<T>::dense(data.data(), extent);
    for (const Index leaf : {1, 2, 4, 8, 16}) {
      std::vector<ValueRange<T>> ranges;
      leaf_ranges(samples, leaf, ranges);
      const Int3 grid = leaf_grid(extent, leaf);
      ASSERT_EQ(ranges.size(), static_cast<std::size_t>(volume(grid)));
      for_each_point({{0, 0, 0}, grid}, [&](Int3 b) {
        EXPECT_EQ(ranges[static_cast<std::size_t>(linear_index(b, grid))],
                  range_of_block(samples, b, leaf));
      });
    }
  }
}

TYPED_TEST(LeafRanges, ReadABoxOfALargerField) {
  using T = TypeParam;
  const Int3 field{30, 20, 10};
  const std::vector<T> data = random_samples<T>(field, 2);
  const SampleBlock<T> box{data.data() + linear_index({3, 2, 1}, field), {18, 11, 6}, 30, 600};
  for (const Index leaf : {1, 4}) {
    std::vector<ValueRange<T>> ranges;
    leaf_ranges(box, leaf, ranges);
    const Int3 grid = leaf_grid(box.extent, leaf);
    for_each_point({{0, 0, 0}, grid}, [&](Int3 b) {
      EXPECT_EQ(ranges[static_cast<std::size_t>(linear_index(b, grid))],
                range_of_block(box, b, leaf));
    });
  }
}

/// Structures × types × leaf sizes: no active cell lies outside of what an index finds.
TYPED_TEST(LeafRanges, LeadEveryStructureToEveryActiveCell) {
  using T = TypeParam;
  const Int3 extent{35, 22, 19};
  Dice dice(3);
  std::vector<T> data;
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    const double wave =
        std::sin(0.2 * static_cast<double>(p.x)) * std::cos(0.3 * static_cast<double>(p.y + p.z));
    data.push_back(value_at<T>(0.5 + 0.45 * wave));
    if constexpr (std::is_floating_point_v<T>)
      if (dice.below(200) == 0) data.back() = std::numeric_limits<T>::quiet_NaN();
  });
  const auto samples = SampleBlock<T>::dense(data.data(), extent);
  std::vector<ValueRange<T>> cells, blocks;
  leaf_ranges(samples, 1, cells);
  const Int3 cell_grid = leaf_grid(extent, 1);
  for (const Index leaf : {1, 2, 4, 8, 16}) {
    leaf_ranges(samples, leaf, blocks);
    const Int3 grid = leaf_grid(extent, leaf);
    for (const IndexKind kind : kIndexKinds) {
      const auto bytes = build_index<T>(kind, blocks, grid);
      const IndexView index = open_index(bytes);
      for (double f = 0; f <= 1; f += 0.03125) {
        const double iso = static_cast<double>(value_at<T>(f));
        std::vector<std::uint32_t> ids;
        query_ascending(index, iso, ids);
        ASSERT_EQ(ids, stabbed(blocks, iso)) << name_of(kind) << ", leaf " << leaf;
        for (const std::uint32_t id : stabbed(cells, iso)) {
          const Index i = id;
          const Int3 cell{i % cell_grid.x, i / cell_grid.x % cell_grid.y,
                          i / (cell_grid.x * cell_grid.y)};
          const Int3 block{cell.x / leaf, cell.y / leaf, cell.z / leaf};
          ASSERT_TRUE(std::binary_search(ids.begin(), ids.end(),
                                         static_cast<std::uint32_t>(linear_index(block, grid))));
        }
      }
    }
  }
}

TEST(LeafGrid, HasNoBlocksWithoutCells) {
  EXPECT_EQ(leaf_grid({65, 65, 65}, 16), (Int3{4, 4, 4}));
  EXPECT_EQ(leaf_grid({66, 64, 2}, 16), (Int3{5, 4, 1}));
  EXPECT_EQ(leaf_grid({1, 64, 64}, 4), (Int3{0, 16, 16}));
  std::vector<ValueRange<float>> ranges(3);
  const float one = 1;
  leaf_ranges(SampleBlock<float>::dense(&one, {1, 1, 1}), 4, ranges);
  EXPECT_TRUE(ranges.empty());
}

TEST(LeafGrid, KnowsFiveLeaves) {
  std::vector<ValueRange<float>> ranges;
  const float samples[8] = {};
  for (const Index leaf : {0, -1, 3, 32})
    EXPECT_THROW(leaf_ranges(SampleBlock<float>::dense(samples, {2, 2, 2}), leaf, ranges),
                 UsageError);
}

}  // namespace
}  // namespace isobrick

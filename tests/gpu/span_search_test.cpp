#include "gpu/search/span_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include <isobrick/device_volume.h>
#include <isobrick/error.h>
#include "index/leaf_ranges.h"
#include "index/span_index.h"
#include "tests/index/range_sets.h"

// Searches and builds on the device give what the definition and the CPU give.

namespace isobrick::inline v0 {
namespace {

template <class T>
using Ranges = std::vector<ValueRange<T>>;

/// Several sets of ranges, one after the other.
template <class T>
struct Batch {
  Ranges<T> ranges;
  std::vector<Int3> grids;

  void add(const Ranges<T>& more, Int3 grid) {
    ranges.insert(ranges.end(), more.begin(), more.end());
    grids.push_back(grid);
  }
  Ranges<T> part(std::size_t i) const {
    std::size_t first = 0;
    for (std::size_t k = 0; k < i; ++k) first += static_cast<std::size_t>(volume(grids[k]));
    const auto begin = ranges.begin() + static_cast<std::ptrdiff_t>(first);
    return {begin, begin + volume(grids[i])};
  }
};

template <class T>
struct BuiltOnCpu {
  std::vector<std::vector<std::byte>> bytes;
  std::vector<IndexView> views;

  BuiltOnCpu(IndexKind kind, const Batch<T>& batch) {
    for (std::size_t i = 0; i < batch.grids.size(); ++i)
      bytes.push_back(build_index<T>(kind, batch.part(i), batch.grids[i]));
    for (const auto& b : bytes) views.push_back(open_index(b));
  }
};

template <class T>
void expect_answers(gpu::SpanSearch& search, const Batch<T>& batch, double isovalue) {
  std::vector<std::uint32_t> expected, expected_first{0};
  for (std::size_t i = 0; i < batch.grids.size(); ++i) {
    const auto ids = stabbed(batch.part(i), isovalue);
    expected.insert(expected.end(), ids.begin(), ids.end());
    expected_first.push_back(static_cast<std::uint32_t>(expected.size()));
  }
  ASSERT_EQ(search.search(isovalue), expected.size()) << "isovalue " << isovalue;
  std::vector<std::uint32_t> first, ids;
  search.answers(first, ids);
  ASSERT_TRUE(ids == expected) << "isovalue " << isovalue;
  ASSERT_TRUE(first == expected_first) << "isovalue " << isovalue;
}

/// Uploaded and built on the device: the bytes are the CPU's, the answers those of
/// the definition.
template <class T>
void compare(const Batch<T>& batch, const std::vector<double>& isovalues) {
  for (const IndexKind kind : kIndexKinds) {
    SCOPED_TRACE(name_of(kind));
    const BuiltOnCpu<T> cpu(kind, batch);
    gpu::SpanSearch uploaded(cpu.views);
    gpu::SpanSearch built(kind, std::span<const ValueRange<T>>(batch.ranges), batch.grids);
    ASSERT_EQ(built.size(), batch.grids.size());
    EXPECT_EQ(built.index_bytes(), uploaded.index_bytes());
    for (std::size_t i = 0; i < cpu.bytes.size(); ++i) {
      ASSERT_TRUE(uploaded.download(i) == cpu.bytes[i]) << "uploaded, index " << i;
      ASSERT_TRUE(built.download(i) == cpu.bytes[i]) << "built, index " << i;
    }
    for (const double isovalue : isovalues) {
      expect_answers(uploaded, batch, isovalue);
      if (::testing::Test::HasFatalFailure()) return;
    }
    for (const double isovalue : {isovalues.front(), isovalues.back()})
      expect_answers(built, batch, isovalue);
    if (::testing::Test::HasFatalFailure()) return;
  }
}

template <class T>
class GpuSpanSearch : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  }
};

using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(GpuSpanSearch, SampleTypes);

TYPED_TEST(GpuSpanSearch, SetsThatAreHardOnOneStructureOrAnother) {
  using T = TypeParam;
  for (const std::size_t n : {17u, 700u})
    for (const RangeSet<T>& set : range_sets<T>(n)) {
      SCOPED_TRACE(set.name + ", " + std::to_string(set.ranges.size()) + " ranges");
      Batch<T> batch;
      batch.add(set.ranges, set.grid);
      compare(batch, isovalues_for(set.ranges, 4));
      if (::testing::Test::HasFatalFailure()) return;
    }
}

TYPED_TEST(GpuSpanSearch, ManySetsAtOnce) {
  using T = TypeParam;
  Batch<T> batch;
  std::vector<double> isovalues;
  for (const RangeSet<T>& set : range_sets<T>(300)) {
    batch.add(set.ranges, set.grid);
    for (const double isovalue : isovalues_for(set.ranges, 1)) isovalues.push_back(isovalue);
  }
  for (int i = 0; i < 3; ++i) batch.add({}, {0, 0, 0});
  compare(batch, isovalues);
}

TYPED_TEST(GpuSpanSearch, MoreThanOneWarpAndOneBlockHaveWork) {
  using T = TypeParam;
  const Int3 grid{61, 67, 29};
  Dice dice(5);
  const auto n = static_cast<std::size_t>(volume(grid));
  const auto set = list_of<T>("", n, [&](double f) {
    return dice.below(7) ? range_at<T>(f, std::min(1.0, f + 0.3 * dice.unit() * dice.unit()))
                         : ValueRange<T>{};
  });
  const auto equal = list_of<T>("", n, [&](double) { return range_at<T>(0.3, 0.6); });
  std::vector<double> isovalues;
  for (const double f : {0.0, 0.1, 0.301, 0.5, 0.599, 0.77, 1.0})
    isovalues.push_back(static_cast<double>(value_at<T>(f)));
  Batch<T> one, flat, same, both;
  one.add(set.ranges, grid);
  flat.add(set.ranges, set.grid);
  same.add(equal.ranges, {1, 1, static_cast<Index>(n)});
  both.add(set.ranges, grid);
  both.add(equal.ranges, grid);
  for (const Batch<T>* batch : {&one, &flat, &same, &both}) {
    compare(*batch, isovalues);
    if (::testing::Test::HasFatalFailure()) return;
  }
}

/// The cells and leaf blocks of bricks, as bricks have them.
TYPED_TEST(GpuSpanSearch, LeavesOfBricks) {
  using T = TypeParam;
  const Int3 extent{70, 45, 38};
  std::vector<T> samples;
  for (Index i = 0; i < volume(extent); ++i) {
    const auto wave = [&](Index v, double k) { return std::sin(static_cast<double>(v) * k); };
    samples.push_back(
        value_at<T>(0.5 + 0.16 * (wave(i % extent.x, 0.2) + wave(i / extent.x % extent.y, 0.23) +
                                  wave(i / (extent.x * extent.y), 0.17))));
  }
  for (const Index leaf : {1, 2, 4, 8, 16}) {
    SCOPED_TRACE("leaf " + std::to_string(leaf));
    Batch<T> batch;
    for_each_point({{0, 0, 0}, ceil_div(extent - Int3{1, 1, 1}, {32, 32, 32})}, [&](Int3 brick) {
      const Int3 lo = brick * 32, hi = min(lo + Int3{33, 33, 33}, extent);
      const SampleBlock<T> block{samples.data() + linear_index(lo, extent), hi - lo, extent.x,
                                 extent.x * extent.y};
      Ranges<T> ranges;
      leaf_ranges(block, leaf, ranges);
      batch.add(ranges, leaf_grid(hi - lo, leaf));
    });
    compare(batch, {static_cast<double>(value_at<T>(0.5)), static_cast<double>(value_at<T>(0.93)),
                    static_cast<double>(value_at<T>(0.2)) + 0.5});
    if (::testing::Test::HasFatalFailure()) return;
  }
}

TYPED_TEST(GpuSpanSearch, WhatCannotBeIndexedIsRefused) {
  using T = TypeParam;
  using Range = ValueRange<T>;
  const Ranges<T> ranges(6, range_at<T>(0.2, 0.4));
  const std::span<const Range> view(ranges);
  constexpr Index huge = Index{1} << 62;
  for (const std::vector<Int3>& grids : {std::vector<Int3>{},
                                         {{1, 2, 2}},
                                         {{6, 1, 1}, {1, 1, 1}},
                                         {{huge, huge, huge}},
                                         {{5, 1, 1}, {-1, -1, 1}}})
    EXPECT_THROW(gpu::SpanSearch(IndexKind::octree, view, grids), UsageError);
  EXPECT_THROW(gpu::SpanSearch(std::vector<IndexView>{}), UsageError);
  const auto a = build_index<T>(IndexKind::kdtree, view, {6, 1, 1});
  const auto b = build_index<T>(IndexKind::interval, view, {6, 1, 1});
  EXPECT_THROW(gpu::SpanSearch({open_index(a), open_index(b)}), UsageError);
}

TYPED_TEST(GpuSpanSearch, MayBeMoved) {
  using T = TypeParam;
  const Ranges<T> ranges(100, range_at<T>(0.2, 0.4));
  const std::vector<Int3> grids{{100, 1, 1}};
  gpu::SpanSearch a(IndexKind::quadtree, std::span<const ValueRange<T>>(ranges), grids);
  gpu::SpanSearch b = std::move(a);
  EXPECT_EQ(b.search(static_cast<double>(value_at<T>(0.3))), 100u);
  EXPECT_EQ(b.kind(), IndexKind::quadtree);
  EXPECT_EQ(b.type(), scalar_type_of<T>);
  EXPECT_GT(b.build_milliseconds(), 0);
  EXPECT_GT(b.search_milliseconds(), 0);
  EXPECT_GT(b.device_bytes(), b.index_bytes());
}

}  // namespace
}  // namespace isobrick

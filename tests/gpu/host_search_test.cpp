#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isobrick/core/morton.h"
#include "isobrick/gpu/host_search.h"

namespace isobrick::gpu {
namespace {

using Range = HostSearch::Range;

std::vector<Int3> tiles_in_a_row(std::size_t count) {
  std::vector<Int3> tiles;
  for (std::size_t i = 0; i < count; ++i) tiles.push_back({static_cast<Index>(i), 1, 2});
  return tiles;
}

bool is_found(const FoundTiles& found, std::size_t tile) {
  return found.words[tile / 32] >> (tile % 32) & 1u;
}

TEST(HostSearch, FindsWhatAnIsovalueStabs) {
  for (const std::size_t count : {1u, 31u, 32u, 33u, 100u, 500u, kMostCandidates}) {
    std::vector<Range> ranges;
    for (std::size_t i = 0; i < count; ++i) {
      const auto lo = static_cast<double>(i * 7 % 50);
      ranges.push_back({lo, lo + static_cast<double>(i % 9)});
    }
    const HostSearch search(tiles_in_a_row(count), ranges);
    for (const double isovalue : {-1.0, 0.0, 3.0, 24.5, 30.0, 57.0, 58.0, 1e9}) {
      const FoundTiles found = search.find(isovalue);
      std::uint32_t expected = 0;
      for (std::size_t i = 0; i < kMostCandidates; ++i) {
        const bool stabbed = i < count && ranges[i].stabbed_by(isovalue);
        EXPECT_EQ(is_found(found, i), stabbed) << i << " of " << count << " at " << isovalue;
        if (stabbed && expected < kMostActiveInSlabs && count <= kMostInSlabs) {
          EXPECT_EQ(found.tiles[expected], FoundTiles::packed(static_cast<std::uint32_t>(i), 1, 2));
        }
        expected += stabbed;
      }
      EXPECT_EQ(found.count, expected);
    }
  }
}

/// Neighbours in double of ends that are floats.
TEST(HostSearch, FloatsStandForAnyIsovalue) {
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> ends{-infinity, -3.4e38f, -1,  -0.1f, 0,       1e-45f,
                           0.1f,      1,        255, 65535, 3.4e38f, infinity};
  std::vector<Range> ranges;
  for (const double lo : ends)
    for (const double hi : ends)
      if (lo <= hi) ranges.push_back({lo, hi});
  const HostSearch search(tiles_in_a_row(ranges.size()), ranges);
  for (const double end : ends)
    for (const double isovalue :
         {end, std::nextafter(end, infinity), std::nextafter(end, -infinity)}) {
      const FoundTiles found = search.find(isovalue);
      for (std::size_t i = 0; i < ranges.size(); ++i)
        EXPECT_EQ(is_found(found, i), ranges[i].stabbed_by(isovalue)) << i << " at " << isovalue;
    }
}

/// Tiles of a grid in Morton order, some with an empty range.
TEST(HostSearch, FindsTheSameThroughAnIndex) {
  for (const Int3 grid : {Int3{1, 1, 1}, Int3{5, 3, 2}, Int3{7, 9, 11}, Int3{16, 8, 8}}) {
    std::vector<Int3> tiles;
    std::vector<Range> ranges;
    for_each_morton(grid, [&](Int3 t) {
      tiles.push_back(t);
      const auto lo = static_cast<double>((t.x * 7 + t.y * 13 + t.z * 5) % 50);
      ranges.push_back(tiles.size() % 7 == 3
                           ? Range{}
                           : Range{lo, lo + static_cast<double>((t.x + t.y * t.z) % 9)});
    });
    const HostSearch by_ranges(tiles, ranges);
    for (const IndexKind kind : kIndexKinds) {
      const HostSearch search(tiles, ranges, kind, grid);
      for (const double isovalue : {-1.0, 0.0, 3.0, 24.5, 30.0, 57.0, 58.0, 1e9}) {
        SCOPED_TRACE(std::string(name_of(kind)) + " at " + std::to_string(isovalue));
        const FoundTiles expected = by_ranges.find(isovalue), found = search.find(isovalue);
        EXPECT_EQ(found.count, expected.count);
        EXPECT_TRUE(std::ranges::equal(found.words, expected.words));
        EXPECT_TRUE(std::ranges::equal(found.tiles, expected.tiles));
      }
    }
  }
}

TEST(HostSearch, EmptyRangesAndNoneAreNeverActive) {
  const double infinity = std::numeric_limits<double>::infinity();
  const HostSearch search(tiles_in_a_row(4),
                          {Range{}, Range{1, 2}, Range{}, Range{-infinity, infinity}});
  for (const double isovalue : {-1e300, 1.5, 1e300}) {
    const FoundTiles found = search.find(isovalue);
    EXPECT_FALSE(is_found(found, 0));
    EXPECT_EQ(is_found(found, 1), isovalue == 1.5);
    EXPECT_FALSE(is_found(found, 2));
    EXPECT_TRUE(is_found(found, 3));
  }
  EXPECT_EQ(search.find(std::nan("")).count, 0u);
  EXPECT_EQ(HostSearch({}, {}).find(0).count, 0u);
}

}  // namespace
}  // namespace isobrick::gpu

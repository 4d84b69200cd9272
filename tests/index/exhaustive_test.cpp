#include <gtest/gtest.h>

#include "index/span_index.h"
#include "range_sets.h"

namespace isobrick::inline v0 {
namespace {

using u8 = std::uint8_t;

bool marks_right(const IndexView& index, const std::vector<ValueRange<u8>>& ranges, double iso) {
  std::vector<std::uint64_t> expected(mask_words(ranges.size())), words(expected.size());
  std::uint64_t answers = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const std::uint64_t stabbed = ranges[i].stabbed_by(iso) ? 1 : 0;
    expected[i / 64] |= stabbed << (i % 64);
    answers += stabbed;
  }
  mark(index, iso, words);
  return words == expected && count(index, iso) == answers;
}

/// Every range of bytes there is, at every isovalue that makes a difference.
TEST(Exhaustive, AllRangesOfBytesAtAllIsovalues) {
  std::vector<ValueRange<u8>> ranges;
  for (int lo = 0; lo < 256; ++lo)
    for (int hi = 0; hi < 256; ++hi)
      if (lo <= hi || (lo + hi) % 16 == 0)
        ranges.push_back({static_cast<u8>(lo), static_cast<u8>(hi)});
  for (const IndexKind kind : kIndexKinds) {
    const auto bytes = build_index<u8>(kind, ranges, {static_cast<Index>(ranges.size()), 1, 1});
    const IndexView index = open_index(bytes);
    for (double iso = -1; iso <= 257; iso += 0.5)
      ASSERT_TRUE(marks_right(index, ranges, iso)) << name_of(kind) << " at " << iso;
  }
}

/// Every list of one, two and three ranges over four values, empty ones included.
TEST(Exhaustive, AllShortListsOfFewValues) {
  std::vector<ValueRange<u8>> all;
  for (int lo = 0; lo < 4; ++lo)
    for (int hi = 0; hi < 4; ++hi) all.push_back({static_cast<u8>(lo), static_cast<u8>(hi)});
  for (const IndexKind kind : kIndexKinds)
    for (std::size_t n = 1; n <= 3; ++n)
      for (std::size_t code = 0; code < std::size_t{1} << (4 * n); ++code) {
        std::vector<ValueRange<u8>> ranges;
        for (std::size_t i = 0; i < n; ++i) ranges.push_back(all[code >> (4 * i) & 15]);
        const auto bytes = build_index<u8>(kind, ranges, {1, static_cast<Index>(n), 1});
        const IndexView index = open_index(bytes);
        for (double iso = -0.5; iso <= 3.5; iso += 0.5)
          ASSERT_TRUE(marks_right(index, ranges, iso)) << name_of(kind) << ", " << code;
      }
}

}  // namespace
}  // namespace isobrick

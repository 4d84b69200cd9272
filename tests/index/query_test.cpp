#include <gtest/gtest.h>

#include <algorithm>

#include <isobrick/error.h>
#include "core/morton.h"
#include "index/span_index.h"
#include "range_sets.h"

namespace isobrick::inline v0 {
namespace {

std::vector<std::uint32_t> sorted(std::vector<std::uint32_t> ids) {
  std::sort(ids.begin(), ids.end());
  return ids;
}

std::uint64_t morton_of(std::uint32_t id, Int3 grid) {
  const Index i = id;
  return morton_encode({i % grid.x, i / grid.x % grid.y, i / (grid.x * grid.y)});
}

/// The order that span_index.h promises.
void expect_order(const IndexView& index, const std::vector<std::uint32_t>& ids) {
  if (index.kind() == IndexKind::linear) {
    EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
  }
  if (index.kind() == IndexKind::octree) {
    EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end(), [&](std::uint32_t a, std::uint32_t b) {
      return morton_of(a, index.grid()) < morton_of(b, index.grid());
    }));
  }
}

/// All queries agree with the definition.
template <class T>
bool answers_right(const IndexView& index, const std::vector<ValueRange<T>>& ranges, double iso) {
  const std::vector<std::uint32_t> expected = stabbed(ranges, iso);
  std::vector<std::uint32_t> ids;
  query(index, iso, ids);
  expect_order(index, ids);
  std::vector<std::uint32_t> ascending{7};
  query_ascending(index, iso, ascending);
  std::vector<std::uint64_t> words(mask_words(index.items()));
  mark(index, iso, words);
  std::vector<std::uint32_t> marked;
  for (std::uint32_t i = 0; i < index.items(); ++i)
    if (words[i / 64] >> (i % 64) & 1) marked.push_back(i);
  return sorted(ids) == expected && marked == expected && count(index, iso) == expected.size() &&
         count_steps(index, iso).answers == expected.size() && ascending.front() == 7 &&
         std::vector(ascending.begin() + 1, ascending.end()) == expected;
}

template <class T>
class Query : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(Query, SampleTypes);

TYPED_TEST(Query, AnswersAsTheDefinitionSays) {
  using T = TypeParam;
  for (const std::size_t n : {3u, 20u, 700u})
    for (const RangeSet<T>& set : range_sets<T>(n)) {
      const std::vector<double> isovalues = isovalues_for(set.ranges, 12);
      for (const IndexKind kind : kIndexKinds) {
        const auto bytes = build_index<T>(kind, set.ranges, set.grid);
        const IndexView index = open_index(bytes);
        for (const double iso : isovalues)
          ASSERT_TRUE(answers_right(index, set.ranges, iso))
              << name_of(kind) << ", " << set.name << ", " << set.ranges.size() << " ranges, at "
              << iso;
      }
    }
}

TYPED_TEST(Query, FindsFewAmongManyAscending) {
  using T = TypeParam;
  const RangeSet<T> set = list_of<T>("", 30000, [](double f) { return range_at<T>(f, f + 1e-4); });
  for (const IndexKind kind : kIndexKinds) {
    const auto bytes = build_index<T>(kind, set.ranges, {30, 100, 10});
    const IndexView index = open_index(bytes);
    for (const double f : {0.0, 0.3, 0.99})
      ASSERT_TRUE(answers_right(index, set.ranges, static_cast<double>(value_at<T>(f))));
  }
}

TYPED_TEST(Query, OneInputMakesTheSameBytes) {
  using T = TypeParam;
  for (const RangeSet<T>& set : range_sets<T>(300))
    for (const IndexKind kind : kIndexKinds) {
      const auto bytes = build_index<T>(kind, set.ranges, set.grid);
      EXPECT_EQ(bytes, build_index<T>(kind, set.ranges, set.grid));
      // What is never active does not count.
      auto same = set.ranges;
      for (auto& range : same)
        if (!(range.lo < range.hi)) range = {T(3), T(3)};
      EXPECT_EQ(bytes, build_index<T>(kind, same, set.grid)) << name_of(kind) << ", " << set.name;
    }
}

TEST(QueryOrder, OfOneSignedZeroMakesNoOther) {
  const std::vector<ValueRange<float>> negative{{-0.0f, 1.0f}, {-1.0f, -0.0f}};
  const std::vector<ValueRange<float>> positive{{0.0f, 1.0f}, {-1.0f, 0.0f}};
  for (const IndexKind kind : kIndexKinds)
    EXPECT_EQ(build_index<float>(kind, negative, {2, 1, 1}),
              build_index<float>(kind, positive, {2, 1, 1}));
}

TEST(BuildIndex, KnowsItsKindTypeAndGrid) {
  const std::vector<ValueRange<std::int16_t>> ranges(24, {1, 2});
  for (const IndexKind kind : kIndexKinds) {
    const auto bytes = build_index<std::int16_t>(kind, ranges, {2, 3, 4});
    const IndexView index = open_index(bytes);
    EXPECT_EQ(index.kind(), kind);
    EXPECT_EQ(index.type(), ScalarType::i16);
    EXPECT_EQ(index.items(), 24u);
    EXPECT_EQ(index.stored(), 24u);
    EXPECT_EQ(index.grid(), (Int3{2, 3, 4}));
    EXPECT_EQ(index.bytes(), bytes.size());
    EXPECT_EQ(parse_index_kind(name_of(kind)), kind);
  }
  EXPECT_FALSE(parse_index_kind("btree"));
}

TEST(BuildIndex, RefusesAGridThatIsNotThatOfTheRanges) {
  const std::vector<ValueRange<float>> ranges(6);
  constexpr Index huge = Index{1} << 62;
  for (const Int3 grid : {Int3{1, 2, 2}, Int3{6, 1, 0}, Int3{-1, -6, 1}, Int3{huge, huge, huge},
                          Int3{huge, 4, 6}, Int3{6, 1, huge}})
    EXPECT_THROW(build_index<float>(IndexKind::octree, ranges, grid), UsageError);
  EXPECT_NO_THROW(build_index<float>(IndexKind::octree, ranges, {1, 6, 1}));
}

TEST(Mark, RefusesAMaskThatIsTooSmall) {
  const std::vector<ValueRange<float>> ranges(65, {0, 1});
  const auto bytes = build_index<float>(IndexKind::interval, ranges, {65, 1, 1});
  std::vector<std::uint64_t> words(1);
  EXPECT_THROW(mark(open_index(bytes), 0.5, words), UsageError);
}

/// Stores keep these bytes: whoever changes them raises IndexHeader::kVersion.
TEST(BuildIndex, BytesAreFrozen) {
  const auto fnv = [](const std::vector<std::byte>& bytes) {
    std::uint64_t hash = 0xcbf29ce484222325;
    for (const std::byte b : bytes) hash = (hash ^ static_cast<std::uint64_t>(b)) * 0x100000001b3;
    return hash;
  };
  std::vector<ValueRange<std::int16_t>> ranges;
  for (int i = 0; i < 210; ++i) {
    const int at = i * 7919 % 251 - 120;
    ranges.push_back({static_cast<std::int16_t>(at), static_cast<std::int16_t>(at + i % 13)});
  }
  const std::uint64_t golden[] = {3725322803379301196u, 14410600070620946544u, 6206777115236427606u,
                                  7407461310833687039u, 14963241789324277171u};
  for (const IndexKind kind : kIndexKinds)
    EXPECT_EQ(fnv(build_index<std::int16_t>(kind, ranges, {7, 6, 5})),
              golden[static_cast<int>(kind)])
        << name_of(kind);
}

}  // namespace
}  // namespace isobrick

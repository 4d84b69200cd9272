#include "index/label_lists.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

#include <isobrick/error.h>

namespace isobrick::test {
namespace {

constexpr std::int64_t kMin = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();

void expect_equal(const std::vector<LabelList>& a, const std::vector<LabelList>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].labels, b[i].labels);
    EXPECT_EQ(a[i].is_cut, b[i].is_cut);
  }
}

LabelList many(std::size_t count) {
  std::mt19937_64 random(count);
  std::set<std::int64_t> labels;
  while (labels.size() < count) labels.insert(static_cast<std::int64_t>(random()));
  return {{labels.begin(), labels.end()}};
}

TEST(LabelLists, AreWhatWasPacked) {
  for (const std::vector<LabelList>& lists :
       {std::vector<LabelList>{},
        {{}},
        {{{7}}, {}, {{}, true}, {{-3, 0, 1, 128, 70000}}},
        {{{kMin, -1, 0, kMax}}, {{kMin, kMax}}, {{kMax}}, {{kMin}}},
        {many(LabelList::kMaxLabels), many(500)}}) {
    const std::vector<std::byte> bytes = pack_label_lists(lists);
    EXPECT_LE(bytes.size(), max_label_list_bytes(lists.size()));
    expect_equal(unpack_label_lists(bytes, lists.size()), lists);
    EXPECT_THROW(unpack_label_lists(bytes, lists.size() + 1), DamageError);
  }
}

/// The bytes are documented: docs/reference/index_format.md.
TEST(LabelLists, HaveTheDocumentedBytes) {
  const std::vector<std::byte> bytes =
      pack_label_lists(std::vector<LabelList>{{{-2, 3, 300}}, {{}, true}, {}});
  const std::vector<int> expected{16, 0, 0, 0, 21, 0, 0, 0,    22, 0, 0, 0,
                                  23, 0, 0, 0, 4,  3, 4, 0xa8, 2,  0, 1};
  ASSERT_EQ(bytes.size(), expected.size());
  for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(static_cast<int>(bytes[i]), expected[i]);
}

TEST(LabelLists, UniteIsTheUnionUntilItIsCut) {
  LabelList list{{1, 5}};
  list.unite({{0, 5, 9}});
  EXPECT_EQ(list.labels, (std::vector<std::int64_t>{0, 1, 5, 9}));
  LabelList large = many(LabelList::kMaxLabels);
  large.unite({{large.labels.front()}});
  EXPECT_FALSE(large.is_cut);
  large.unite({{large.labels.front() + 1}});
  EXPECT_TRUE(large.is_cut);
  EXPECT_TRUE(large.labels.empty());
  list.unite(large);
  EXPECT_TRUE(list.is_cut);
}

/// Lists that are read are ascending, and nothing is read beyond the bytes.
TEST(LabelLists, DamageIsRefusedOrMakesOtherLists) {
  const std::vector<LabelList> lists{{{kMin, -1, 0, kMax}}, {{}, true}, many(40), {}};
  const std::vector<std::byte> good = pack_label_lists(lists);
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_THROW(unpack_label_lists(std::span(good).first(size), lists.size()), DamageError);
  std::size_t refused = 0;
  for (std::size_t at = 0; at < good.size(); ++at)
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::byte> changed = good;
      changed[at] ^= static_cast<std::byte>(1 << bit);
      try {
        for (const LabelList& list : unpack_label_lists(changed, lists.size()))
          EXPECT_TRUE(std::is_sorted(list.labels.begin(), list.labels.end(),
                                     [](auto a, auto b) { return a <= b; }));
      } catch (const DamageError&) {
        ++refused;
      }
    }
  EXPECT_GT(refused, 100u);
}

}  // namespace
}  // namespace isobrick::test

#include <gtest/gtest.h>

#include <cstring>

#include <isobrick/error.h>
#include "index/span_index.h"
#include "range_sets.h"

namespace isobrick::inline v0 {
namespace {

/// Opens bytes that may be anything. Those that pass must answer within bounds;
/// a sanitizer sees to it that nothing else happens. True when they were refused.
bool refused(const std::vector<std::byte>& bytes) {
  try {
    const IndexView index = open_index(bytes);
    std::vector<std::uint64_t> words(mask_words(index.items()));
    for (const double iso : {-1e9, -100.5, 0.0, 3.0, 77.25, 128.0, 1e5}) {
      std::vector<std::uint32_t> ids;
      query(index, iso, ids);
      for (const std::uint32_t id : ids) EXPECT_LT(id, index.items());
      query_ascending(index, iso, ids);
      mark(index, iso, words);
      count(index, iso);
    }
    return false;
  } catch (const DamageError&) {
    return true;
  }
}

template <class T>
std::vector<std::vector<std::byte>> indices() {
  Dice dice(5);
  std::vector<ValueRange<T>> ranges;
  for (int i = 0; i < 60; ++i) {
    const double at = dice.unit();
    ranges.push_back(i % 7 == 0 ? ValueRange<T>{} : range_at<T>(at, at * dice.unit()));
  }
  std::vector<std::vector<std::byte>> all;
  for (const IndexKind kind : kIndexKinds) all.push_back(build_index<T>(kind, ranges, {5, 4, 3}));
  return all;
}

template <class T>
class Damage : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(Damage, SampleTypes);

TYPED_TEST(Damage, TruncatedIndicesAreRefused) {
  for (const auto& whole : indices<TypeParam>()) {
    for (std::size_t n = 0; n < whole.size(); ++n)
      EXPECT_TRUE(refused({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)}));
    // Also when the header agrees.
    for (std::uint64_t n = sizeof(IndexHeader); n < whole.size(); ++n) {
      std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n));
      std::memcpy(cut.data() + offsetof(IndexHeader, bytes), &n, sizeof n);
      EXPECT_TRUE(refused(cut));
    }
    auto longer = whole;
    longer.resize(longer.size() + 8);
    EXPECT_TRUE(refused(longer));
  }
}

TYPED_TEST(Damage, ChangedBytesAreRefusedOrAnswerWithinBounds) {
  for (auto bytes : indices<TypeParam>())
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const std::byte before = bytes[i];
      for (const int flip : {0x01, 0x10, 0x80, 0xff}) {
        bytes[i] = before ^ static_cast<std::byte>(flip);
        const bool was_refused = refused(bytes);
        if (i < sizeof(IndexHeader)) {
          // Kind, type and extents may change to others of equal sizes.
          const bool may_pass = (i >= 5 && i <= 6) || i >= offsetof(IndexHeader, grid);
          EXPECT_TRUE(was_refused || may_pass) << "byte " << i;
        }
      }
      bytes[i] = before;
    }
}

TYPED_TEST(Damage, RandomChangesAreRefusedOrAnswerWithinBounds) {
  Dice dice(6);
  for (const auto& whole : indices<TypeParam>())
    for (int round = 0; round < 400; ++round) {
      auto bytes = whole;
      for (std::uint64_t n = 1 + dice.below(6); n; --n) {
        const std::size_t at = 8 + dice.below(bytes.size() - 8);
        bytes[at] = static_cast<std::byte>(dice.below(4) ? dice.below(256) : 0xff);
      }
      refused(bytes);
    }
}

TEST(Damage, HugeCountsAreRefused) {
  for (const auto& whole : indices<double>())
    for (const std::size_t field :
         {offsetof(IndexHeader, items), offsetof(IndexHeader, stored), offsetof(IndexHeader, nodes),
          offsetof(IndexHeader, points), offsetof(IndexHeader, grid)}) {
      auto bytes = whole;
      constexpr std::uint32_t huge = 0xffffffff;
      std::memcpy(bytes.data() + field, &huge, sizeof huge);
      EXPECT_TRUE(refused(bytes));
      for (const std::size_t other : {offsetof(IndexHeader, items), offsetof(IndexHeader, nodes)})
        std::memcpy(bytes.data() + other, &huge, sizeof huge);
      EXPECT_TRUE(refused(bytes));
    }
}

TEST(Damage, BytesOutOfPlaceAreAnErrorOfTheCaller) {
  const auto whole = indices<float>().front();
  std::vector<std::byte> shifted(whole.size() + 1);
  std::copy(whole.begin(), whole.end(), shifted.begin() + 1);
  EXPECT_THROW(open_index(std::span(shifted).subspan(1)), UsageError);
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/label_index.h>
#include <isobrick/label_pieces.h>
#include <isobrick/verify.h>
#include "tests/pipeline/labels_fixture.h"

// The largest and the smallest labels of 64 bits, and those where a sign begins.

namespace isobrick::test {
namespace {

constexpr std::uint64_t kLargestU64 = std::numeric_limits<std::uint64_t>::max();

template <class T>
class EndsOfIntegers : public Labels {
 protected:
  using Limits = std::numeric_limits<T>;

  /// In place of the labels 0 … 7.
  static std::vector<T> labels() {
    if constexpr (std::is_signed_v<T>)
      return {0, Limits::min(), Limits::min() + 1, -2, -1, 1, Limits::max() - 1, Limits::max()};
    else
      return {0,
              1,
              kLargestU64 / 2,
              kLargestU64 / 2 + 1,
              kLargestU64 / 2 + 2,
              kLargestU64 - 2,
              kLargestU64 - 1,
              kLargestU64};
  }
  Field<T> field() const {
    const auto small = cells<std::uint8_t>({70, 40, 36}, 7, 4);
    Field<T> far(small.extent, [](Int3) { return 0.0; });
    const std::vector<T> all = labels();
    std::transform(small.samples.begin(), small.samples.end(), far.samples.begin(),
                   [&](std::uint8_t label) { return all[label]; });
    return far;
  }
  Meshes expected() {
    Meshes far;
    for (const auto& [label, mesh] :
         meshes_of(store(cells<std::uint8_t>({70, 40, 36}, 7, 4)), {.labels = {{0, 7}}}))
      far.emplace(labels()[label.bits()], mesh);
    return far;
  }
};
using EndTypes = ::testing::Types<std::uint64_t, std::int64_t>;
TYPED_TEST_SUITE(EndsOfIntegers, EndTypes);

TYPED_TEST(EndsOfIntegers, HaveMeshes) {
  using T = TypeParam;
  auto expected = this->expected();
  ASSERT_EQ(expected.size(), 8u);
  const Label top = std::numeric_limits<T>::max(), bottom = std::numeric_limits<T>::min();
  const StoreReader store = this->store(this->field(), 16);
  const LabelOptions all{.labels = {{bottom, top}}};
  EXPECT_EQ(this->meshes_of(store, all), expected);
  std::vector<Label> in_order(expected.size());
  extract_labels(store, all, [&](const LabelMesh& mesh) { in_order[mesh.index()] = mesh.label(); });
  EXPECT_TRUE(std::is_sorted(in_order.begin(), in_order.end()));
  std::vector<std::filesystem::path> pieces;
  for (std::uint32_t i = 1; i <= 2; ++i) {
    pieces.push_back(this->folder_ / ("p" + std::to_string(i)));
    extract_label_piece(store, all, {i, 2}, pieces.back());
  }
  EXPECT_EQ(this->collect(
                [&](const LabelVisitor& visit) { return merge_label_pieces(pieces, {}, visit); }),
            expected);
  const auto without_top = this->meshes_of(store, {.background = top});
  EXPECT_EQ(without_top.size(), 7u);
  EXPECT_EQ(without_top.count(top), 0u);
  expected.erase(0);
  EXPECT_EQ(this->meshes_of(store), expected);
}

TYPED_TEST(EndsOfIntegers, AreChosenByListsAndRanges) {
  using T = TypeParam;
  const auto expected = this->expected();
  const StoreReader store = this->store(this->field(), 16);
  add_label_index(store.storage()->local_path(), {});
  const StoreReader listed(store.storage()->local_path());
  for (const T label : this->labels()) {
    SCOPED_TRACE(label);
    LabelReport report;
    const auto meshes = this->meshes_of(listed, {.labels = {{label, label}}}, &report);
    EXPECT_GT(report.index_bytes, 0u);
    ASSERT_EQ(meshes.size(), 1u);
    EXPECT_EQ(meshes.begin()->first, label);
    EXPECT_EQ(meshes.begin()->second, expected.at(label));
  }
  EXPECT_TRUE(verify(listed.storage()->local_path()).damages.empty());
  const T before_top = std::numeric_limits<T>::max() - 1;
  for (const bool uses_lists : {false, true}) {
    const auto some =
        this->meshes_of(listed, {.labels = {{1, before_top}}, .use_lists = uses_lists});
    EXPECT_EQ(some.size(), std::is_signed_v<T> ? 2u : 6u);
    EXPECT_EQ(some.count(before_top), 1u);
  }
}

TYPED_TEST(EndsOfIntegers, HaveNoneOfTheSameBits) {
  using T = TypeParam;
  const StoreReader store = this->store(this->field(), 16);
  const Label other = std::is_signed_v<T> ? Label(kLargestU64) : Label(-1);
  try {
    this->meshes_of(store, {.labels = {{other, other}}});
    ADD_FAILURE() << "accepted";
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("no label " + other.text()), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace isobrick::test

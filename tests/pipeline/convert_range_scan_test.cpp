#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "pipeline/index/range_scan.h"
#include "tests/pipeline/convert_doubles.h"

namespace isobrick::inline v0 {
namespace {

using test::brute_range;
using test::make_samples;

template <class T>
class RangeScan : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(RangeScan, SampleTypes);

/// Feeds a volume in boxes of at most `piece` and compares every range.
template <class T>
void check_ranges(const std::vector<T>& samples, Int3 extent, Int3 piece, Index brick) {
  const Lattice lattice{extent, {brick, brick, brick}, scalar_type_of<T>};
  const auto ranges = make_level_ranges(lattice);
  Index next_block = 0, next_brick = 0;
  const auto compare = [&](Index edge, Index& next) {
    return [&samples, extent, edge, &next](Box3 items, std::span<const std::byte> pairs) {
      ASSERT_EQ(items.lo.z, next++);
      ASSERT_EQ(pairs.size(), static_cast<std::size_t>(volume(items.extent())) * 2 * sizeof(T));
      const auto* range = reinterpret_cast<const ValueRange<T>*>(pairs.data());
      for_each_point(items, [&](Int3 item) {
        const ValueRange<T> expected = brute_range(samples, extent, item, edge);
        ASSERT_EQ(range->lo, expected.lo) << item.x << ' ' << item.y << ' ' << item.z;
        ASSERT_EQ(range->hi, expected.hi) << item.x << ' ' << item.y << ' ' << item.z;
        ++range;
      });
    };
  };
  const RangeEmit blocks = compare(kBlockEdge, next_block), bricks = compare(brick, next_brick);
  std::vector<T> buffer;
  const Int3 pieces = ceil_div(extent, piece);
  for (Index z = 0; z < pieces.z; ++z) {
    for_each_point({{0, 0, z}, {pieces.x, pieces.y, z + 1}}, [&](Int3 p) {
      const Box3 box = intersect({p * piece, (p + Int3{1, 1, 1}) * piece}, lattice.box());
      buffer.resize(static_cast<std::size_t>(volume(box.extent())));
      test::copy_box(reinterpret_cast<const std::byte*>(samples.data()), extent, sizeof(T), box,
                     reinterpret_cast<std::byte*>(buffer.data()));
      ranges->add(box, reinterpret_cast<const std::byte*>(buffer.data()));
    });
    ranges->close(std::min((z + 1) * piece.z, extent.z), blocks, bricks);
  }
  EXPECT_EQ(next_block, lattice.blocks().z);
  EXPECT_EQ(next_brick, lattice.bricks().z);
  bool nan = false;
  for (const T v : samples) nan |= v != v;
  EXPECT_EQ(ranges->has_nan(), nan);
}

TYPED_TEST(RangeScan, EqualsBruteForceWhateverThePieces) {
  for (const Int3 extent : {Int3{67, 50, 41}, Int3{33, 17, 16}, Int3{1, 1, 1}, Int3{130, 1, 49}}) {
    const auto samples = make_samples<TypeParam>(extent, 7, true);
    for (const Int3 piece : {extent, Int3{16, 16, 16}, Int3{extent.x, extent.y, 32}, Int3{7, 9, 5}})
      for (const Index brick : {16, 20, 32, 33}) check_ranges(samples, extent, piece, brick);
  }
}

/// Each brick alone, and then all of them.
TYPED_TEST(RangeScan, RangesOfPartsAreMerged) {
  using T = TypeParam;
  const Int3 extent{67, 50, 41};
  const auto samples = make_samples<T>(extent, 7, true);
  for (const Index edge : {16, 20, 32, 33}) {
    const Lattice lattice{extent, {edge, edge, edge}, scalar_type_of<T>};
    const auto whole = make_level_ranges(lattice);
    std::size_t compared = 0;
    const auto compare = [&](Index of_item) {
      return [&, of_item](Box3 items, std::span<const std::byte> pairs) {
        const auto* range = reinterpret_cast<const ValueRange<T>*>(pairs.data());
        for_each_point(items, [&](Int3 item) {
          EXPECT_EQ(*range++, brute_range(samples, extent, item, of_item));
          ++compared;
        });
      };
    };
    std::vector<T> buffer;
    for (Index z = 0; z < lattice.bricks().z; ++z) {
      for_each_point({{0, 0, z}, {lattice.bricks().x, lattice.bricks().y, z + 1}}, [&](Int3 b) {
        const Box3 box = lattice.brick_box(b);
        buffer.resize(static_cast<std::size_t>(volume(box.extent())));
        test::copy_box(reinterpret_cast<const std::byte*>(samples.data()), extent, sizeof(T), box,
                       reinterpret_cast<std::byte*>(buffer.data()));
        const auto part = make_part_ranges(lattice, box);
        part->add(box, reinterpret_cast<const std::byte*>(buffer.data()));
        part->close(
            box.hi.z, [&](Box3 items, auto pairs) { whole->merge_blocks(items, pairs); },
            [&](Box3 items, auto pairs) { whole->merge_bricks(items, pairs); });
      });
      whole->close(std::min((z + 1) * edge, extent.z), compare(kBlockEdge), compare(edge));
    }
    EXPECT_EQ(compared,
              static_cast<std::size_t>(volume(lattice.blocks()) + volume(lattice.bricks())));
    // What a damaged part may have.
    const std::vector<std::byte> pair(2 * sizeof(T));
    EXPECT_THROW(whole->merge_blocks({{0, 0, 0}, {1, 1, 1}}, pair), Error);
    EXPECT_THROW(make_level_ranges(lattice)->merge_blocks({{5, 0, 0}, {6, 1, 1}}, pair), Error);
  }
}

TYPED_TEST(RangeScan, RowsLongerThanTheCacheWindow) {
  const Int3 extent{9001, 3, 18};
  check_ranges(make_samples<TypeParam>(extent, 3), extent, extent, 64);
}

TEST(RangeScanFloats, NothingButNanIsEmpty) {
  const Int3 extent{20, 20, 20};
  check_ranges(std::vector<float>(8000, std::numeric_limits<float>::quiet_NaN()), extent, extent,
               16);
}

TEST(RangeScanFloats, ZerosHaveOneSign) {
  std::vector<float> samples(16 * 16 * 16, -0.0f);
  RangeScanner<float> scanner({{0, 0, 0}, {16, 16, 16}}, {16, 16, 16});
  scanner.add({{0, 0, 0}, {16, 16, 16}}, samples.data());
  scanner.close(16, [](Box3, std::span<const std::byte> pairs) {
    for (const std::byte b : pairs) EXPECT_EQ(b, std::byte{0});
  });
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <set>

#include "core/morton.h"
#include "tests/gpu/kernels/kernel_volume.h"
#include "tests/gpu/strided_samples.h"

// The kernels that find the ranges of an array's tiles and copy tiles to blocks.

namespace isobrick::testing {
namespace {

/// An array, and what the kernels make of it.
template <class T>
class KernelArray {
 public:
  Lattice lattice;
  std::vector<Int3> tiles;  ///< in Morton order
  std::vector<T> ranges;
  std::uint32_t found_nan = 0, item_count = 0;
  gpu::ArrayBlockCounts counts{};
  std::vector<T> blocks, columns;
  std::vector<std::uint32_t> block_of_tile, places;

  KernelArray(const Field<T>& field, const SampleLayout& layout)
      : lattice{field.extent, {64, 64, 64}, scalar_type_of<T>}, samples_(field, layout) {
    std::vector<std::int32_t> order;
    for_each_morton(lattice.tiles(), [&](Int3 t) {
      tiles.push_back(t);
      for (int axis = 0; axis < 3; ++axis) order.push_back(static_cast<std::int32_t>(t[axis]));
    });
    ranges.resize(2 * tiles.size());
    std::vector<ValueRange<T>> parts(8 * tiles.size());
    gpu::ArrayRangeParams p{};
    p.array = array();
    p.count = static_cast<std::uint32_t>(tiles.size());
    p.part_ranges = parts.data();
    p.found_nan = &found_nan;
    p.order = order.data();
    p.ranges = ranges.data();
    emulated::run_array_ranges(lattice.type, p, 1);
    block_of_tile.assign(tiles.size(), gpu::kNone);
  }

  void make_room(std::uint32_t room) {
    blocks.assign((room + std::size_t{1}) * gpu::kTileBlockSamples, T{});
    columns.assign((room + std::size_t{1}) * gpu::kColumnSamples, T{});
    places.assign(room, 0);
  }

  /// Makes blocks of what these tiles look at.
  void load(const std::vector<Int3>& active, int reach) {
    std::vector<gpu::TileItem> items;
    for (const Int3 t : active)
      items.push_back({static_cast<std::int32_t>(t.x), static_cast<std::int32_t>(t.y),
                       static_cast<std::int32_t>(t.z), 0});
    item_count = static_cast<std::uint32_t>(items.size());
    counts.copied = counts.wanted;
    gpu::ArrayLoadParams p{};
    p.array = array();
    p.items = items.data();
    const std::uint32_t found = item_count;
    p.found = &found;
    p.item_count = &item_count;
    p.reach = reach;
    p.block_of_tile = block_of_tile.data();
    p.places = places.data();
    p.counts = &counts;
    p.room = static_cast<std::uint32_t>(places.size());
    p.tile_blocks = blocks.data();
    p.columns = columns.data();
    emulated::run_load(lattice.type, p, 1);
  }

  std::size_t place(Int3 tile) const {
    return static_cast<std::size_t>(linear_index(tile, lattice.tiles()));
  }
  void expect_block(const Field<T>& field, Int3 tile) const {
    const std::uint32_t number = block_of_tile[place(tile)];
    ASSERT_TRUE(number > 0 && number <= places.size());
    const T* block = blocks.data() + std::size_t{number} * gpu::kTileBlockSamples;
    const T* column = columns.data() + std::size_t{number} * gpu::kColumnSamples;
    const Int3 lo = tile * Index{32};
    for_each_point(intersect({lo, lo + Int3{32, 32, 32}}, field.box()), [&](Int3 p) {
      const Int3 at = p - lo;
      const T expected = field.at(p);
      ASSERT_EQ(std::memcmp(&block[linear_index(at, {32, 32, 32})], &expected, sizeof(T)), 0);
      if (at.x > 0) return;
      ASSERT_EQ(std::memcmp(&column[at.y + 32 * at.z], &expected, sizeof(T)), 0);
    });
  }

 private:
  gpu::ArrayParams array() const {
    gpu::ArrayParams p{};
    p.samples = samples_.memory.data() + samples_.first;
    for (int axis = 0; axis < 3; ++axis) {
      p.strides[axis] = samples_.strides[axis] / static_cast<Index>(sizeof(T));
      p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
      p.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
    }
    return p;
  }

  StridedSamples<T> samples_;
};

template <class T>
void compare(const Field<T>& field, const SampleLayout& layout) {
  SCOPED_TRACE(layout.name);
  KernelArray<T> array(field, layout);
  for (std::size_t i = 0; i < array.tiles.size(); ++i) {
    const Int3 lo = array.tiles[i] * Index{32};
    ValueRange<T> range;
    for_each_point(intersect({lo, lo + Int3{33, 33, 33}}, field.box()),
                   [&](Int3 p) { range.include(field.at(p)); });
    ASSERT_EQ(array.ranges[2 * i], range.lo) << "tile " << i;
    ASSERT_EQ(array.ranges[2 * i + 1], range.hi) << "tile " << i;
  }
  array.make_room(static_cast<std::uint32_t>(array.tiles.size()));
  array.load(array.tiles, 0);
  EXPECT_EQ(array.counts.wanted, array.tiles.size());
  for (const Int3 tile : array.tiles) array.expect_block(field, tile);
}

template <class T>
class ArrayKernels : public ::testing::Test, public TestFields<T> {};

TYPED_TEST_SUITE(ArrayKernels, KernelTypes);

TYPED_TEST(ArrayKernels, ArraysOfAnyLayout) {
  for (const SampleLayout& layout : kSampleLayouts) {
    compare(this->noise({40, 33, 34}, 1), layout);
  }
}

TEST(ArrayKernelsOf, ThinArrays) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 40, 2}, Int3{33, 1, 1}, Int3{2, 3, 65}})
    for (const SampleLayout& layout : kSampleLayouts)
      compare(TestFields<std::int16_t>::noise(extent, 3), layout);
}

TEST(ArrayKernelsOf, NaNIsFoundAndLeftOutOfRanges) {
  const auto field = TestFields<float>::noise({40, 35, 33}, 4);
  const auto holed = with_nan(field, 5, 9);
  for (const SampleLayout& layout : kSampleLayouts) {
    compare(holed, layout);
    EXPECT_EQ(KernelArray<float>(holed, layout).found_nan, 1u);
    EXPECT_EQ(KernelArray<float>(field, layout).found_nan, 0u);
  }
  compare(Field<double>({5, 4, 3}, [](Int3) { return std::nan(""); }), kSampleLayouts[0]);
}

TEST(ArrayKernelsOf, OnlyTilesThatActiveOnesLookAtBecomeBlocksAndOnlyOnce) {
  const auto field = TestFields<std::uint8_t>::noise({130, 100, 70}, 6);
  KernelArray<std::uint8_t> array(field, kSampleLayouts[0]);
  array.make_room(40);
  array.load({{1, 1, 0}}, 0);
  EXPECT_EQ(array.counts.wanted, 8u);
  for_each_point({{1, 1, 0}, {3, 3, 2}}, [&](Int3 t) { array.expect_block(field, t); });
  EXPECT_EQ(array.block_of_tile[array.place({0, 0, 0})], gpu::kNone);
  const std::vector<std::uint32_t> before = array.block_of_tile;
  // What is a block already is not copied again.
  array.blocks.assign(array.blocks.size(), 0);
  array.load({{1, 1, 0}, {4, 3, 2}}, 1);
  EXPECT_EQ(array.item_count, 2u);
  for_each_point({{1, 1, 0}, {3, 3, 2}}, [&](Int3 t) {
    EXPECT_EQ(array.block_of_tile[array.place(t)], before[array.place(t)]);
  });
  EXPECT_EQ(array.blocks[std::size_t{before[array.place({1, 1, 0})]} * gpu::kTileBlockSamples], 0);
  for (const Int3 t : {Int3{0, 0, 0}, Int3{0, 2, 1}, Int3{4, 3, 2}, Int3{3, 2, 1}})
    array.expect_block(field, t);
  EXPECT_EQ(array.block_of_tile[array.place({0, 3, 0})], gpu::kNone);
}

TEST(ArrayKernelsOf, WithoutRoomNothingIsCopiedAndNoTileIsActive) {
  const auto field = TestFields<std::uint8_t>::noise({130, 100, 70}, 6);
  KernelArray<std::uint8_t> array(field, kSampleLayouts[0]);
  array.make_room(7);
  array.load({{1, 1, 0}}, 0);
  EXPECT_EQ(array.counts.wanted, 8u);
  EXPECT_EQ(array.item_count, 0u);
  EXPECT_EQ(std::set<std::uint8_t>(array.blocks.begin(), array.blocks.end()).size(), 1u);
}

}  // namespace
}  // namespace isobrick::testing

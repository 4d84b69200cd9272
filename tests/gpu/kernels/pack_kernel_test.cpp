#include <gtest/gtest.h>

#include "core/morton.h"
#include "gpu/tile/tile_block.h"
#include "tests/gpu/kernels/kernel_volume.h"
#include "tests/gpu/strided_samples.h"

// The kernels that copy an array to tile blocks.

namespace isobrick::testing {
namespace {

/// What they make of an array.
template <class T>
struct Packed {
  Lattice lattice;
  std::vector<Int3> tiles;
  std::vector<std::int32_t> order;
  std::vector<T> blocks, columns, ranges;
  std::vector<ValueRange<T>> part_ranges;
  std::uint32_t found_nan = 0;

  Packed(const Field<T>& field, const SampleLayout& layout)
      : lattice{field.extent, {64, 64, 64}, scalar_type_of<T>} {
    for_each_morton(lattice.tiles(), [&](Int3 t) {
      tiles.push_back(t);
      for (int axis = 0; axis < 3; ++axis) order.push_back(static_cast<std::int32_t>(t[axis]));
    });
    blocks.resize((tiles.size() + 1) * gpu::kTileBlockSamples);
    columns.resize((tiles.size() + 1) * gpu::kColumnSamples);
    ranges.resize(2 * tiles.size());
    part_ranges.resize(8 * tiles.size());
    const StridedSamples<T> samples(field, layout);
    gpu::PackParams p{};
    p.samples = samples.memory.data() + samples.first;
    for (int axis = 0; axis < 3; ++axis) {
      p.strides[axis] = samples.strides[axis] / static_cast<Index>(sizeof(T));
      p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
      p.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
    }
    p.order = order.data();
    p.count = static_cast<std::uint32_t>(tiles.size());
    p.tile_blocks = blocks.data();
    p.columns = columns.data();
    p.part_ranges = part_ranges.data();
    p.ranges = ranges.data();
    p.found_nan = &found_nan;
    emulated::run_pack(lattice.type, p, 1);
  }
};

template <class T>
void compare(const Field<T>& field, const SampleLayout& layout) {
  SCOPED_TRACE(layout.name);
  const Packed<T> packed(field, layout);
  for (std::size_t i = 0; i < packed.tiles.size(); ++i) {
    const Int3 tile = packed.tiles[i], lo = tile * Index{32};
    const auto place = static_cast<std::size_t>(linear_index(tile, packed.lattice.tiles()));
    const T* block = packed.blocks.data() + (place + 1) * gpu::kTileBlockSamples;
    const T* columns = packed.columns.data() + (place + 1) * gpu::kColumnSamples;
    for_each_point(intersect({lo, lo + Int3{32, 32, 32}}, field.box()), [&](Int3 p) {
      const Int3 at = p - lo;
      const T expected = field.at(p);
      ASSERT_EQ(std::memcmp(&block[linear_index(at, {32, 32, 32})], &expected, sizeof(T)), 0);
      if (at.x > 0) return;
      ASSERT_EQ(std::memcmp(&columns[at.y + 32 * at.z], &expected, sizeof(T)), 0);
    });
    ValueRange<T> range;
    for_each_point(intersect({lo, lo + Int3{33, 33, 33}}, field.box()),
                   [&](Int3 p) { range.include(field.at(p)); });
    ASSERT_EQ(packed.ranges[2 * i], range.lo) << "tile " << i;
    ASSERT_EQ(packed.ranges[2 * i + 1], range.hi) << "tile " << i;
  }
}

template <class T>
class PackKernel : public ::testing::Test, public TestFields<T> {};

TYPED_TEST_SUITE(PackKernel, KernelTypes);

TYPED_TEST(PackKernel, ArraysOfAnyLayout) {
  for (const SampleLayout& layout : kSampleLayouts) {
    compare(this->noise({67, 41, 35}, 1), layout);
    compare(this->noise({64, 32, 33}, 2), layout);
  }
}

TYPED_TEST(PackKernel, ThinArrays) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 40, 2}, Int3{33, 1, 1}, Int3{2, 3, 65}})
    for (const SampleLayout& layout : kSampleLayouts) compare(this->noise(extent, 3), layout);
}

TEST(PackKernelOf, NaNIsFoundAndLeftOutOfRanges) {
  const auto field = TestFields<float>::noise({40, 35, 33}, 4);
  const auto holed = with_nan(field, 5, 9);
  for (const SampleLayout& layout : kSampleLayouts) {
    compare(holed, layout);
    EXPECT_EQ(Packed<float>(holed, layout).found_nan, 1u);
    EXPECT_EQ(Packed<float>(field, layout).found_nan, 0u);
  }
  Field<double> nothing({5, 4, 3}, [](Int3) { return std::nan(""); });
  compare(nothing, kSampleLayouts[0]);
}

}  // namespace
}  // namespace isobrick::testing

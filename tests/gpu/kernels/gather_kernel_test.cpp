#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "core/dense_bricks.h"
#include "core/tile.h"
#include "gpu/stream/brick_table.h"
#include "gpu/tile/tile_block.h"
#include "tests/gpu/kernels/kernel_volume.h"

// Tiles that a device gathers from bricks are those that the CPU gathers.

namespace isobrick::testing {
namespace {

constexpr std::size_t kTileSamples = 32 * 32 * 32;

/// Memory is aligned as that of a device.
struct alignas(16) AlignedBytes {
  std::byte bytes[16];
};

/// Without every third brick.
class SomeBricks final : public BrickLookup {
 public:
  SomeBricks(const BrickLookup& all, const Lattice& lattice) : all_(all), grid_(lattice.bricks()) {}
  const std::byte* find(Int3 b) const override {
    return linear_index(b, grid_) % 3 == 1 ? nullptr : all_.find(b);
  }

 private:
  const BrickLookup& all_;
  Int3 grid_;
};

/// The samples of a tile that lie in the volume.
template <class T>
std::vector<T> inside(const Lattice& lattice, Int3 tile, const T* block) {
  std::vector<T> samples;
  for_each_point(intersect({tile * 32, tile * 32 + Int3{32, 32, 32}}, lattice.box()), [&](Int3 p) {
    samples.push_back(block[linear_index(p - tile * 32, {32, 32, 32})]);
  });
  return samples;
}

template <class T>
void compare(const Lattice& lattice, const BrickLookup& bricks) {
  std::vector<Int3> tiles;
  for_each_point({{0, 0, 0}, lattice.tiles()}, [&](Int3 t) { tiles.push_back(t); });
  std::vector<std::int32_t> places;
  for (const Int3 t : tiles)
    for (int axis = 0; axis < 3; ++axis) places.push_back(static_cast<std::int32_t>(t[axis]));
  const std::size_t of_tile = max_bricks_of_tile(lattice, kFirstCorners);
  std::vector<gpu::BrickBox> boxes(tiles.size());
  std::vector<std::uint64_t> addresses(tiles.size() * of_tile);
  gpu::locate_bricks(lattice, tiles, bricks, {boxes, addresses});

  constexpr double kFill = 17;
  std::vector<AlignedBytes> memory(tiles.size() * kTileSamples * sizeof(T) / 16);
  T* const blocks = reinterpret_cast<T*>(memory.data());
  std::fill_n(blocks, tiles.size() * kTileSamples, T{93});
  gpu::GatherParams p{};
  p.tiles = places.data();
  p.boxes = boxes.data();
  p.bricks = addresses.data();
  p.count = static_cast<std::uint32_t>(tiles.size());
  p.tile_bricks = static_cast<std::uint32_t>(of_tile);
  for (int axis = 0; axis < 3; ++axis) {
    p.brick[axis] = static_cast<std::int32_t>(lattice.brick[axis]);
    p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
  }
  p.fill_value = kFill;
  p.tile_blocks = blocks;
  emulated::run_gather(lattice.type, p, 1);

  std::vector<T> expected(kTileSamples);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    gpu::gather_tile_block(lattice, bricks, kFill, tiles[i],
                           reinterpret_cast<std::byte*>(expected.data()));
    ASSERT_EQ(inside(lattice, tiles[i], blocks + i * kTileSamples),
              inside(lattice, tiles[i], expected.data()))
        << "tile " << i;
  }
}

template <class T>
class GatherKernel : public ::testing::Test {};
TYPED_TEST_SUITE(GatherKernel, KernelTypes);

TYPED_TEST(GatherKernel, TilesAreThoseOfTheCpu) {
  for (const Int3 extent : {Int3{75, 40, 67}, Int3{32, 64, 33}, Int3{1, 2, 3}})
    for (const Int3 brick :
         {Int3{64, 64, 64}, Int3{33, 20, 47}, Int3{16, 16, 16}, Int3{8, 40, 5}}) {
      SCOPED_TRACE(::testing::Message() << extent.x << " of bricks " << brick.x);
      const auto field = TestFields<TypeParam>::noise(extent, 3);
      const Lattice lattice{extent, brick, scalar_type_of<TypeParam>};
      const DenseBricks bricks(lattice, field.samples.data());
      compare<TypeParam>(lattice, bricks);
      compare<TypeParam>(lattice, SomeBricks(bricks, lattice));
    }
}

}  // namespace
}  // namespace isobrick::testing

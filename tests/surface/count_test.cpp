#include <gtest/gtest.h>

#include "tests/surface/field.h"

namespace isobrick::inline v0 {
namespace {

using testing::Field;

template <class T>
void expect_tiles_add_up(const Field<T>& field, double isovalue, bool may_have_nan,
                         bool drop_degenerate = false) {
  const Lattice lattice{field.extent, {32, 32, 32}, scalar_type_of<T>};
  const DenseBricks bricks(lattice, field.samples.data());
  std::vector<TileWork> tiles;
  append_active_tiles<T>({{0, 0, 0}, lattice.blocks()}, testing::block_ranges(field), isovalue,
                         tiles);
  ASSERT_GT(tiles.size(), 4u);
  SurfaceOptions options;
  options.isovalue = isovalue;
  options.roi = lattice.box();
  options.may_have_nan = may_have_nan;
  options.drop_degenerate = drop_degenerate;
  MeshSize sum;
  const CpuExtractor counter(lattice, options, {});
  for (auto tile = tiles.rbegin(); tile != tiles.rend(); ++tile) {
    const MeshSize size = counter.count(*tile, bricks);
    sum.vertices += size.vertices;
    sum.triangles += size.triangles;
  }
  const auto mesh = testing::extract(
      field, {.isovalue = isovalue, .brick = {32, 32, 32}, .drop_degenerate = drop_degenerate});
  EXPECT_EQ(sum.vertices, mesh.positions.size());
  EXPECT_EQ(sum.triangles, mesh.triangles.size());
}

TEST(Count, TilesInAnyOrderAddUpToTheMesh) {
  expect_tiles_add_up(testing::padded_noise<std::uint8_t>({70, 81, 66}, 0, 255, 0, 3), 128, false);
  auto field = testing::padded_noise<float>({70, 50, 66}, 0, 1, 0, 4);
  for (std::size_t i = 0; i < field.samples.size(); i += 97) field.samples[i] = NAN;
  expect_tiles_add_up(field, 0.5, true);
  const auto coarse = testing::padded_noise<std::uint8_t>({70, 81, 66}, 0, 4, 0, 3);
  expect_tiles_add_up(coarse, 2, false, true);
}

}  // namespace
}  // namespace isobrick

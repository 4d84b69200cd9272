#pragma once

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/open_source.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/volumes/test_samples.h"

namespace isobrick::inline v0 {

/// A small number as a value, which may be a half: those are made of floats.
template <class Value>
Value number(int i) {
  return static_cast<Value>(static_cast<float>(i));
}

/// Values of their own for voxels, tiles of several sizes and inactive voxels.
template <class Grid>
typename Grid::Ptr make_grid(typename Grid::ValueType background) {
  using Value = typename Grid::ValueType;
  const auto grid = Grid::create(background);
  grid->setName("v");
  grid->tree().fill(openvdb::CoordBBox({-20, -8, 0}, {11, 15, 40}), static_cast<Value>(1));
  grid->tree().fill(openvdb::CoordBBox({-20, -8, 16}, {-5, 7, 31}), static_cast<Value>(3), false);
  auto accessor = grid->getAccessor();
  for (int i = 0; i < 300; ++i)
    accessor.setValue({i * 7 % 31 - 20, i * 5 % 23 - 8, i * 3 % 40}, number<Value>(i % 50));
  for (int i = 0; i < 50; ++i) accessor.setValueOff({i % 31 - 20, 9, i * 3 % 40}, number<Value>(i));
  return grid;
}

/// A leaf for each way in which OpenVDB stores inactive values: none but the background, its
/// negative, another one; two of these; more.
template <class Grid>
void add_inactive_values(Grid& grid) {
  using Value = typename Grid::ValueType;
  const Value background = grid.background(), minus = -background;
  const Value five = 5, six = 6, seven = 7;
  const std::vector<Value> ways[] = {
      {background}, {minus},           {five}, {background, minus}, {five, background},
      {five, six},  {five, six, seven}};
  auto accessor = grid.getAccessor();
  int x = 64;
  for (const std::vector<Value>& way : ways) {
    for (int i = 0; i < 512; ++i) {
      const openvdb::Coord at{x + (i >> 6), i >> 3 & 7, i & 7};
      if (i % 3 == 0)
        accessor.setValue(at, number<Value>(i));
      else
        accessor.setValueOff(at, way[static_cast<std::size_t>(i * 7 % 11) % way.size()]);
    }
    x += 8;
  }
}

class Vdb : public ::testing::Test {
 protected:
  Vdb() { openvdb::initialize(); }

  std::string write(const openvdb::GridCPtrVec& grids) const {
    openvdb::io::File(dir / "v.vdb").write(grids);
    return dir / "v.vdb";
  }

  /// The file that was written last, as if its version were another.
  std::string with_version(std::uint32_t version) const {
    std::string bytes = dir.read("v.vdb");
    std::memcpy(bytes.data() + 8, &version, sizeof version);
    std::filesystem::remove(dir / "v.vdb");
    return dir.write("v.vdb", bytes);
  }

  /// Every voxel of the box of active ones against OpenVDB's accessor.
  template <class Out, class Grid>
  void expect_same(const Grid& grid, const std::string& path,
                   const VolumeRequest& request = {}) const {
    const auto source = open_source(path, request);
    ASSERT_EQ(source->info().type, scalar_type_of<Out>);
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const Int3 extent = source->info().extent;
    ASSERT_EQ(extent, (Int3{box.dim().x(), box.dim().y(), box.dim().z()}));
    // The last one does not begin where leaves do.
    for (const Box3 part : {Box3{{0, 0, 0}, extent}, Box3{{5, 3, 9}, {27, 4, 33}}}) {
      std::vector<Out> samples(static_cast<std::size_t>(volume(part.extent())));
      source->read(part, reinterpret_cast<std::byte*>(samples.data()));
      const auto accessor = grid.getConstAccessor();
      std::size_t at = 0, different = 0;
      for_each_point(part, [&](Int3 p) {
        const openvdb::Coord c =
            box.min().offsetBy(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
        different += samples[at++] != static_cast<Out>(accessor.getValue(c)) ? 1 : 0;
      });
      EXPECT_EQ(different, 0U);
    }
  }

  TempDir dir;
};

}  // namespace isobrick

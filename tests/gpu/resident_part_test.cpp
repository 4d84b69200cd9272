#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <vector>

#include "core/morton.h"
#include "gpu/resident/resident_sizes.h"
#include "gpu/resident/tile_loader.h"
#include "gpu/stream/brick_pool.h"
#include "surface/surface_extractor.h"
#include "tests/gpu/resident.h"

// Volumes of which only some tiles are on the device.

namespace isobrick::testing {
namespace {

template <class T>
class GpuResidentPart : public DeviceTest<T> {};

TYPED_TEST_SUITE(GpuResidentPart, DeviceTypes);

/// Bricks that were sent to a pool on the device.
class PoolBricks final : public BrickLookup {
 public:
  PoolBricks(const BrickLookup& all, const Lattice& lattice)
      : grid_(lattice.bricks()),
        pool_(0, lattice, static_cast<std::size_t>(volume(grid_)), 1),
        places_(static_cast<std::size_t>(volume(grid_))) {
    for_each_point({{0, 0, 0}, grid_}, [&](Int3 b) {
      const std::byte* const from = all.find(b);
      if (!from) return;
      std::byte* const place = pool_.take(lattice.brick_bytes());
      std::memcpy(pool_.begin(0), from, lattice.brick_bytes());
      pool_.end(0, place);
      places_[static_cast<std::size_t>(linear_index(b, grid_))] = place;
    });
  }
  gpu::BrickPool& pool() { return pool_; }
  const std::byte* find(Int3 b) const override {
    return places_[static_cast<std::size_t>(linear_index(b, grid_))];
  }

 private:
  Int3 grid_;
  gpu::BrickPool pool_;
  std::vector<std::byte*> places_;
};

/// Has only the bricks that some tiles lie in.
class BricksOfTiles final : public BrickLookup {
 public:
  BricksOfTiles(const BrickLookup& all, const Lattice& lattice, std::span<const Int3> tiles)
      : all_(all), lattice_(lattice), has_(static_cast<std::size_t>(volume(lattice.bricks()))) {
    for (const Int3 tile : tiles)
      for_each_needed_box(lattice, {tile, 0xff}, kFirstCorners, [&](Box3 box) {
        for_each_point(lattice.bricks_of(box), [&](Int3 b) { has_[place_of(b)] = 1; });
      });
  }
  const std::byte* find(Int3 b) const override {
    EXPECT_TRUE(has_[place_of(b)]);
    return all_.find(b);
  }

 private:
  std::size_t place_of(Int3 b) const {
    return static_cast<std::size_t>(linear_index(b, lattice_.bricks()));
  }
  const BrickLookup& all_;
  Lattice lattice_;
  std::vector<char> has_;
};

/// The tiles that are active at any of the isovalues, in Morton order.
template <class T>
std::vector<Int3> tiles_of(const Field<T>& field, const std::vector<double>& isovalues) {
  std::map<std::uint64_t, Int3> tiles;
  for (const double isovalue : isovalues)
    for (const TileWork& work : active_tiles(field, isovalue))
      tiles[morton_encode(work.tile)] = work.tile;
  std::vector<Int3> list;
  for (const auto& [code, tile] : tiles) list.push_back(tile);
  return list;
}

/// Some tiles at a time.
void load(gpu::DeviceVolume& volume, const BrickLookup& bricks, const Lattice& lattice,
          std::span<const Int3> tiles) {
  constexpr std::size_t at_once = 7;
  PoolBricks on_device(bricks, lattice);
  gpu::TileLoader loader(volume, on_device.pool(), at_once);
  for (std::size_t i = 0; i < tiles.size(); i += at_once) {
    const auto some = tiles.subspan(i, std::min(at_once, tiles.size() - i));
    loader.load(some, BricksOfTiles(on_device, lattice, some), nullptr);
  }
}

/// Loads the tiles that are active at any isovalue and those beside them, some at a time, and
/// compares the meshes of all isovalues.
template <class T>
void compare_part(const Field<T>& field, const BrickLookup& bricks, const Lattice& lattice,
                  const std::vector<double>& isovalues, SurfaceOptions options) {
  if (options.roi == Box3{}) options.roi = lattice.box();
  const std::vector<Int3> searched = tiles_of(field, isovalues);
  for (const bool normals : {false, true}) {
    options.normals = normals;
    const std::vector<Int3> loaded = gpu::tiles_to_load(lattice, searched, sample_reach(options));
    gpu::DeviceVolume volume(lattice, options.fill_value, {searched, loaded});
    load(volume, bricks, lattice, loaded);
    EXPECT_LE(
        volume.bytes(),
        gpu::resident_sizes(lattice, {searched.size(), loaded.size(), 0}, normals).volume_bytes);
    gpu::ResidentExtractor extractor(volume, options);
    EXPECT_LE(
        extractor.bytes(),
        gpu::resident_sizes(lattice, {searched.size(), loaded.size(), 0}, normals).extractor_bytes);
    for (const double isovalue : isovalues) {
      SCOPED_TRACE("isovalue " + std::to_string(isovalue) + (normals ? ", normals" : ""));
      options.isovalue = isovalue;
      const isobrick::Mesh expected = on_cpu(field, lattice, bricks, options);
      EXPECT_EQ(extractor.extract(isovalue).triangles, expected.triangles.size());
      isobrick::Mesh mesh;
      extractor.download(mesh);
      expect_same(expected, mesh);
      if (::testing::Test::HasFailure()) return;
    }
  }
}

TYPED_TEST(GpuResidentPart, TheTilesThatAreTouchedAreEnough) {
  const auto field = this->waves({131, 70, 197});
  const double mid = this->lowest() + 100;
  for (const Index brick : {20, 32, 64}) {
    const Lattice lattice{field.extent, {brick, brick, brick}, scalar_type_of<TypeParam>};
    const DenseBricks bricks(lattice, field.samples.data());
    compare_part(field, bricks, lattice, {mid + 70.5, mid - 65}, {});
    compare_part(field, bricks, lattice, {mid + 60.5, mid, mid + 1e6}, {});
    compare_part(field, bricks, lattice, {mid + 60.5, mid},
                 {.roi = {{11, 5, 33}, {99, 64, 150}}, .transform = {.spacing = {1, -2, 0.5}}});
  }
  const auto tops = this->waves({131, 67, 99});
  const Lattice lattice{tops.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, tops.samples.data());
  compare_part(tops, bricks, lattice, {mid + 84, mid + 88}, {});
  compare_part(tops, bricks, lattice, {mid + 1e6}, {});
  EXPECT_LT(gpu::tiles_to_load(lattice, tiles_of(tops, {mid + 84, mid + 88}), 1).size(),
            static_cast<std::size_t>(volume(lattice.tiles())))
      << "a part of the volume";
}

TYPED_TEST(GpuResidentPart, APartOfAVolumeHasTheFillValueWhereBricksAreAbsent) {
  const HoledField<TypeParam> holed(this->waves({131, 70, 97}),
                                    static_cast<TypeParam>(this->lowest() + 30));
  compare_part(holed.field, holed, holed.lattice, {this->lowest() + 100.5, this->lowest() + 160},
               holed.options(0));
}

template <class T>
using GpuResidentPartWithNaN = DeviceTest<T>;

TYPED_TEST_SUITE(GpuResidentPartWithNaN, TypesWithNaN);

TYPED_TEST(GpuResidentPartWithNaN, TheTilesThatAreTouchedAreEnough) {
  const auto field = with_nan(this->waves({131, 70, 97}), 1, 300);
  const Lattice lattice{field.extent, {32, 32, 32}, scalar_type_of<TypeParam>};
  compare_part(field, DenseBricks(lattice, field.samples.data()), lattice, {-40, 65},
               {.may_have_nan = true});
}

}  // namespace
}  // namespace isobrick::testing

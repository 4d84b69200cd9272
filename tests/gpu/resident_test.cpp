#include <gtest/gtest.h>

#include <map>
#include <thread>

#include <isobrick/error.h>
#include "core/morton.h"
#include "gpu/resident/resident_sizes.h"
#include "gpu/tile/tile_kernel.h"
#include "surface/surface_extractor.h"
#include "tests/gpu/collecting_sink.h"
#include "tests/gpu/resident.h"

// The mesh from the device is the CPU's, byte for byte.

namespace isobrick::testing {
namespace {

template <class T>
void compare(const Field<T>& field, std::vector<double> isovalues, SurfaceOptions options,
             Index brick = 64, bool brute_force = false) {
  Resident<T> r(field, options, brick);
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    gpu::ResidentExtractor extractor(r.volume, r.options, {.brute_force = brute_force});
    for (const double isovalue : isovalues) {
      r.expect_mesh(extractor, isovalue);
      if (::testing::Test::HasFailure()) return;
    }
  }
}

/// Those that the device has room for.
std::vector<gpu::LaunchShape> all_shapes(ScalarType type, const SurfaceOptions& options) {
  std::vector<gpu::LaunchShape> shapes;
  for (const gpu::LaunchShape& shape : gpu::launch_shapes(gpu::kernel_of(type, options)).shapes)
    if (shape.blocks > 0) shapes.push_back(shape);
  return shapes;
}

template <class T>
class GpuResident : public DeviceTest<T> {};

TYPED_TEST_SUITE(GpuResident, DeviceTypes);

TYPED_TEST(GpuResident, OneTile) { compare(this->waves({33, 33, 33}), {this->lowest() + 100}, {}); }

TYPED_TEST(GpuResident, SmoothFieldOfOddExtents) {
  const double mid = this->lowest() + 100;
  compare(this->waves({131, 70, 97}), {mid - 40, mid, mid + 0.5, mid + 30}, {}, 32);
}

TYPED_TEST(GpuResident, ManyTilesTakeSeveralBlocksOfTheSearch) {
  const double mid = this->lowest() + 100;
  const Field<TypeParam> field({2, 2080, 2070}, [&](Int3 p) {  // 65 × 65 tiles
    return mid + static_cast<double>((p.x * 31 + p.y / 7 * 13 + p.z * p.z / 50) % 150 - 75);
  });
  compare(field, {mid + 74, mid, this->lowest(), mid - 40}, {});
  SurfaceOptions options;
  options.roi = {{0, 31, 100}, {2, 500, 1060}};
  compare(field, {mid}, options);
}

TYPED_TEST(GpuResident, NoiseIsTheHardestInput) {
  const double mid = this->lowest() + 100;
  compare(this->noise({67, 41, 75}, 1), {mid, mid + 0.5, mid - 90}, {}, 16);
}

TYPED_TEST(GpuResident, ExtentsThatFillNoTile) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 40, 40}, Int3{2, 2, 2}, Int3{32, 32, 32},
                            Int3{34, 5, 3}, Int3{3, 65, 34}, Int3{5, 3, 97}})
    compare(this->noise(extent, 7), {this->lowest() + 100}, {});
}

/// A plane of edges at the volume's upper border, and no cell above it.
TYPED_TEST(GpuResident, VolumesThatEndInsideATile) {
  const double mid = this->lowest() + 100;
  for (const Int3 extent : {Int3{33, 33, 9}, Int3{48, 49, 17}, Int3{40, 40, 57}})
    compare(this->noise(extent, 11), {mid}, {});
  SurfaceOptions options;
  options.roi = {{3, 0, 40}, {60, 41, 57}};
  compare(this->noise({67, 41, 75}, 3), {mid}, options);
}

/// A sample that equals the largest of its type is no reason to make anything above.
TYPED_TEST(GpuResident, NoSampleReachesAnIsovalueAboveItsType) {
  using Limits = std::numeric_limits<TypeParam>;
  if constexpr (!Limits::is_integer) {
    GTEST_SKIP() << "no largest value";
  } else {
    const Field<TypeParam> field({40, 33, 35},
                                 [](Int3 p) { return p.x < 17 ? 0.0 : double{Limits::max()}; });
    compare(field, {double{Limits::max()} + 1, 1e9}, {}, 64, true);
  }
}

/// Blocks of 640 threads list more cells at a time, which pays where most tiles have more than
/// blocks of 384 list.
TEST(LaunchShapes, BlocksThatListMoreAreForFullTiles) {
  gpu::LaunchShapes shapes;
  shapes.shapes[0] = {.blocks = 132, .threads = 1024, .listed = 7168};
  shapes.shapes[1] = {.blocks = 264, .threads = 640, .listed = 7168};
  shapes.shapes[2] = {.blocks = 396, .threads = 384, .listed = 2560};
  EXPECT_EQ(shapes.of(4096).threads, 384);
  EXPECT_EQ(shapes.of(4096, 2560).threads, 384);
  EXPECT_EQ(shapes.of(4096, 2561).threads, 640);
  EXPECT_EQ(shapes.of(100, 2561).threads, 1024) << "few tiles";
  shapes.shapes[1].blocks = 0;
  EXPECT_EQ(shapes.of(4096, 2561).threads, 384) << "none that fits the device";
  for (gpu::LaunchShape& shape : shapes.shapes) shape.listed = 512;
  shapes.shapes[1].blocks = 264;
  EXPECT_EQ(shapes.of(4096, 2561).threads, 384) << "all list as many";
}

/// Most of them are empty when every tile is taken; the last one, too.
TYPED_TEST(GpuResident, EmptyTilesPassOnWhatLiesBefore) {
  const Field<TypeParam> dots({100, 97, 131}, [](Int3 p) {
    return (p == Int3{40, 50, 33} || p == Int3{70, 3, 64} || p == Int3{2, 90, 100}) ? 100.0 : 0.0;
  });
  const Lattice lattice{dots.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, dots.samples.data());
  SurfaceOptions options;
  options.isovalue = 50;
  options.roi = lattice.box();
  gpu::DeviceVolume volume(lattice, bricks, 0);
  for (const gpu::LaunchShape& shape : all_shapes(lattice.type, options)) {
    gpu::ResidentExtractor extractor(volume, options, {.brute_force = true, .shape = &shape});
    EXPECT_EQ(extractor.extract(50).active_tiles, 4 * 4 * 5u);
    MeshBuffer mesh;
    extractor.download(mesh);
    EXPECT_EQ(mesh.triangles.size(), 3 * 8u);
    expect_same(on_cpu(dots, lattice, bricks, options), mesh);
  }
}

TYPED_TEST(GpuResident, RegionsOfInterest) {
  const double mid = this->lowest() + 100;
  for (const Box3 roi : {Box3{{5, 3, 7}, {60, 40, 70}}, Box3{{33, 0, 31}, {66, 39, 75}},
                         Box3{{31, 31, 31}, {34, 34, 34}}, Box3{{40, 2, 40}, {41, 20, 60}}}) {
    SurfaceOptions options;
    options.roi = roi;
    compare(this->noise({67, 41, 75}, 3), {mid}, options);
  }
}

TYPED_TEST(GpuResident, CheckerboardNeedsMoreThanSixteenBits) {
  const Field<TypeParam> board({70, 70, 70},
                               [](Int3 p) { return (p.x + p.y + p.z) % 2 ? 100.0 : 0.0; });
  compare(board, {50}, {});
}

TYPED_TEST(GpuResident, TransformsTurnAndMirror) {
  SurfaceOptions options;
  options.transform.spacing = {0.7, 1.3, -2};
  options.transform.origin = {-5, 11, 0.25};
  compare(this->waves({67, 41, 75}), {this->lowest() + 100}, options);
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  compare(this->waves({67, 41, 75}), {this->lowest() + 100}, options);
}

TYPED_TEST(GpuResident, SmallerSamplesInsideTurnTheMeshRound) {
  SurfaceOptions options;
  options.inside = Inside::below;
  for (const bool normals : {false, true}) {
    options.normals = normals;
    compare(this->waves({67, 41, 75}), {this->lowest() + 100}, options);
  }
}

TYPED_TEST(GpuResident, AbsentBricksAreTheFillValue) {
  using T = TypeParam;
  const HoledField<T> holed(this->waves({131, 70, 97}), static_cast<T>(this->lowest() + 30));
  const SurfaceOptions options = holed.options(this->lowest() + 100.5);
  gpu::DeviceVolume volume(holed.lattice, holed, options.fill_value);
  gpu::ResidentExtractor extractor(volume, options);
  EXPECT_GT(extractor.extract(options.isovalue).triangles, 1000u);
  MeshBuffer mesh;
  extractor.download(mesh);
  expect_same(on_cpu(holed.field, holed.lattice, holed.bricks, options), mesh);
}

TYPED_TEST(GpuResident, ARepeatMakesTheSameMesh) {
  const auto field = this->waves({131, 70, 97});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  options.roi = lattice.box();
  gpu::DeviceVolume volume(lattice, bricks, 0);
  gpu::ResidentExtractor extractor(volume, options);
  extractor.extract(this->lowest() + 60);
  extractor.extract(this->lowest() + 100.5);
  MeshBuffer once, again;
  extractor.download(once);
  for (int i = 0; i < 3; ++i) {
    extractor.repeat();
    EXPECT_GT(extractor.milliseconds(), 0);
    extractor.download(again);
    expect_same(once, again);
  }
}

TYPED_TEST(GpuResident, BruteForceMakesTheSameMesh) {
  const auto field = this->waves({131, 70, 197});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  gpu::DeviceVolume volume(lattice, bricks, 0);
  for (const Box3 roi : {lattice.box(), Box3{{5, 33, 40}, {97, 66, 190}}}) {
    options.roi = roi;
    gpu::ResidentExtractor by_ranges(volume, options);
    gpu::ResidentExtractor by_force(volume, options, {.brute_force = true});
    for (const double shift : {0.0, 35.5, -60.0, 1e9}) {
      SCOPED_TRACE(shift);
      const double isovalue = this->lowest() + 100 + shift;
      EXPECT_EQ(by_force.extract(isovalue).triangles, by_ranges.extract(isovalue).triangles);
      MeshBuffer one, other;
      by_ranges.download(one);
      by_force.download(other);
      expect_same(one, other);
    }
  }
}

TYPED_TEST(GpuResident, AnySizeOfBlocksMakesTheSameMesh) {
  const auto field = this->noise({67, 41, 35}, 9);
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  options.roi = {{3, 0, 5}, field.extent};
  gpu::DeviceVolume volume(lattice, bricks, 0);
  for (const bool normals : {false, true}) {
    options.normals = normals;
    gpu::ResidentExtractor usual(volume, options);
    usual.extract(this->lowest() + 100);
    MeshBuffer expected;
    usual.download(expected);
    for (const gpu::LaunchShape& shape : all_shapes(lattice.type, options)) {
      SCOPED_TRACE(std::to_string(shape.threads) + " threads");
      gpu::ResidentExtractor extractor(volume, options, {.shape = &shape});
      extractor.extract(this->lowest() + 100);
      MeshBuffer mesh;
      extractor.download(mesh);
      expect_same(expected, mesh);
    }
  }
}

TYPED_TEST(GpuResident, WhatTheDeviceCannotDoIsRefused) {
  const auto field = this->waves({40, 33, 35});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  gpu::DeviceVolume volume(lattice, bricks, 0);
  SurfaceOptions good;
  good.roi = lattice.box();
  SurfaceOptions dropping = good, local = good, nowhere = good;
  dropping.drop_degenerate = true;
  local.indexing = Indexing::chunk_local;
  nowhere.roi = {{1000, 0, 0}, {1001, 1, 1}};
  EXPECT_THROW(gpu::ResidentExtractor(volume, dropping), UsageError);
  EXPECT_THROW(gpu::ResidentExtractor(volume, local), UsageError);
  EXPECT_THROW(gpu::ResidentExtractor(volume, nowhere), UsageError);
  gpu::ResidentExtractor extractor(volume, good);
  EXPECT_THROW(extractor.extract(std::nan("")), UsageError);
}

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
    gpu::DeviceVolume volume(lattice, options.fill_value, {searched, loaded},
                             3 * 32768 * lattice.sample_bytes());
    for (std::size_t i = 0; i < loaded.size(); i += 7) {
      const auto some = std::span(loaded).subspan(i, std::min<std::size_t>(7, loaded.size() - i));
      volume.load(some, BricksOfTiles(bricks, lattice, some));
    }
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
      const MeshBuffer expected = on_cpu(field, lattice, bricks, options);
      EXPECT_EQ(extractor.extract(isovalue).triangles, expected.triangles.size());
      MeshBuffer mesh;
      extractor.download(mesh);
      expect_same(expected, mesh);
      if (::testing::Test::HasFailure()) return;
    }
  }
}

TYPED_TEST(GpuResident, TheTilesThatAreTouchedAreEnough) {
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

TYPED_TEST(GpuResident, APartOfAVolumeHasTheFillValueWhereBricksAreAbsent) {
  const HoledField<TypeParam> holed(this->waves({131, 70, 97}),
                                    static_cast<TypeParam>(this->lowest() + 30));
  compare_part(holed.field, holed, holed.lattice, {this->lowest() + 100.5, this->lowest() + 160},
               holed.options(0));
}

TYPED_TEST(GpuResident, ASinkGetsTheMeshInChunks) {
  Resident<TypeParam> r(this->waves({131, 70, 97}));
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    gpu::ResidentExtractor extractor(r.volume, r.options);
    for (const std::size_t chunk_bytes :
         {std::size_t{4096}, std::size_t{100000}, std::size_t{1} << 24})
      for (const double shift : {0.5, 70.0, 1e6}) {
        r.options.isovalue = this->lowest() + 100 + shift;
        const MeshBuffer expected = on_cpu(r.field, r.lattice, r.bricks, r.options);
        extractor.extract(r.options.isovalue);
        CollectingSink sink;
        extractor.write(sink, chunk_bytes);
        expect_same(expected, sink.mesh);
        EXPECT_LE(sink.max_chunk, chunk_bytes);
        const SurfaceReport report = extractor.report();
        EXPECT_EQ(report.vertices, expected.positions.size());
        EXPECT_EQ(report.triangles, expected.triangles.size());
        EXPECT_EQ(report.sink.bytes, mesh_bytes({report.vertices, report.triangles}, normals));
        EXPECT_EQ(report.pinned_bytes, 2 * chunk_bytes);
        EXPECT_EQ(report.device_bytes, extractor.bytes());
      }
    extractor.extract(this->lowest() + 100.5);
    FailingSink broken(4);
    EXPECT_THROW(extractor.write(broken, 4096), Error);
    EXPECT_EQ(broken.taken, 4);
  }
}

TYPED_TEST(GpuResident, MeshesAreWrittenAtTheSameTime) {
  Resident<TypeParam> r(this->waves({131, 70, 97}));
  std::vector<std::unique_ptr<gpu::ResidentExtractor>> extractors;
  std::vector<MeshBuffer> expected;
  for (const double shift : {0.5, 30.0, 70.0}) {
    r.options.isovalue = this->lowest() + 100 + shift;
    expected.push_back(on_cpu(r.field, r.lattice, r.bricks, r.options));
    extractors.push_back(std::make_unique<gpu::ResidentExtractor>(r.volume, r.options));
    extractors.back()->extract(r.options.isovalue);
    EXPECT_THROW(extractors.back()->reserve_chunks(23), UsageError);
  }
  std::vector<CollectingSink> sinks(3);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < 3; ++i)
    threads.emplace_back([&, i] { extractors[i]->write(sinks[i], 4096); });
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < 3; ++i) expect_same(expected[i], sinks[i].mesh);
}

TYPED_TEST(GpuResident, AMeshThatDoesNotFitTheBoundIsRefusedAndOthersAreMade) {
  Resident<TypeParam> r(this->noise({67, 41, 75}, 1));
  const double mid = this->lowest() + 100, high = mid + 95;
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    const std::uint64_t empty = gpu::ResidentExtractor(r.volume, r.options).bytes();
    gpu::ResidentExtractor usual(r.volume, r.options);
    const gpu::DeviceCounts large = usual.extract(mid), small = usual.extract(high);
    const auto bound = [&](const gpu::DeviceCounts& counts) {
      return empty + mesh_bytes({counts.vertices, counts.triangles}, normals);
    };
    ASSERT_LT(2 * small.triangles, large.triangles);
    gpu::ResidentExtractor tight(r.volume, r.options, {}, bound(large));
    for (const double isovalue : {high, mid, high}) r.expect_mesh(tight, isovalue);
    EXPECT_LE(tight.bytes(), bound(large));
    gpu::ResidentExtractor tighter(r.volume, r.options, {}, bound(large) - 1);
    r.expect_mesh(tighter, high);
    EXPECT_THROW(tighter.extract(mid), gpu::OutOfDeviceMemory);
    MeshBuffer none;
    tighter.download(none);
    EXPECT_EQ(none.positions.size(), 0u) << "a mesh that was not made";
    r.expect_mesh(tighter, high);
    EXPECT_LT(tighter.bytes(), bound(large));
  }
}

using GpuResidentWithNaN = DeviceTest<float>;

TEST_F(GpuResidentWithNaN, TheTilesThatAreTouchedAreEnough) {
  const auto field = with_nan(waves({131, 70, 97}), 1, 300);
  const Lattice lattice{field.extent, {32, 32, 32}, ScalarType::f32};
  compare_part(field, DenseBricks(lattice, field.samples.data()), lattice, {-40, 65},
               {.may_have_nan = true});
}

TEST_F(GpuResidentWithNaN, IsTheMeshOfTheCpu) {
  SurfaceOptions options;
  options.may_have_nan = true;
  compare(waves({131, 70, 97}), {0, 30}, options);
  compare(with_nan(waves({131, 70, 97}), 1, 300), {0, -40}, options, 32);
  compare(with_nan(noise({67, 41, 75}, 2), 3, 20), {0}, options, 16);
  compare(with_nan(noise({33, 32, 34}, 5), 4, 3), {0}, options);
  compare(with_nan(waves({3, 1030, 1060}), 5, 50), {0}, options);
}

TEST_F(GpuResidentWithNaN, RegionsAndMirrors) {
  const auto field = with_nan(noise({67, 41, 75}, 7), 8, 15);
  for (const Box3 roi : {Box3{{5, 3, 7}, {60, 40, 70}}, Box3{{33, 0, 31}, {66, 39, 75}},
                         Box3{{31, 31, 31}, {34, 34, 34}}}) {
    SurfaceOptions options;
    options.may_have_nan = true;
    options.roi = roi;
    options.transform.spacing = {-1, 2, 1};
    compare(field, {0}, options);
  }
}

TYPED_TEST(GpuResident, IsovaluesBeyondTheRangeGiveNothing) {
  compare(this->waves({67, 41, 75}), {-1e9, 1e9}, {});
}

}  // namespace
}  // namespace isobrick::testing

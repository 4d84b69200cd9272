#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "gpu/tile/tile_kernel.h"
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

TYPED_TEST(GpuResident, DegenerateTrianglesAreLeftOut) {
  SurfaceOptions options;
  options.drop_degenerate = true;
  const double mid = this->lowest() + 100;
  // With isovalues that samples equal and others in turn.
  compare(this->coarse({67, 41, 75}, 1), {mid, mid + 0.5, mid + 1}, options);
  compare(this->waves({131, 70, 97}), {mid - 40, mid, mid + 0.5}, options, 32);
  for (unsigned seed = 0; seed < 40; ++seed) compare(this->at_a_corner(seed), {mid}, options);
  options.roi = {{3, 0, 31}, {50, 33, 64}};
  options.transform.spacing = {0.7, 1.3, -2};
  compare(this->coarse({67, 41, 75}, 2), {mid}, options);
}

TYPED_TEST(GpuResident, TheTrilinearInterpolantIsFollowed) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  const double mid = this->lowest() + 100;
  compare(this->noise({67, 41, 75}, 1), {mid, mid + 0.5, mid - 30}, options);
  compare(this->coarse({67, 41, 75}, 1), {mid, mid + 1}, options);
  compare(this->waves({131, 70, 97}), {mid - 40, mid}, options, 32);
  options.roi = {{3, 0, 31}, {50, 33, 64}};
  options.transform.spacing = {0.7, 1.3, -2};
  compare(this->noise({67, 41, 75}, 2), {mid}, options);
}

TYPED_TEST(GpuResident, TheBorderIsCapped) {
  SurfaceOptions options;
  options.cap = true;
  const double mid = this->lowest() + 100;
  for (const Inside inside : {Inside::above, Inside::below})
    for (const Topology topology : {Topology::consistent, Topology::trilinear})
      for (const bool drop : {false, true}) {
        options.inside = inside;
        options.topology = topology;
        options.drop_degenerate = drop;
        compare(this->coarse({67, 41, 75}, 1), {mid, mid + 0.5, mid + 1}, options);
        compare(this->waves({131, 70, 97}), {mid - 40, mid}, options, 32);
      }
  for (unsigned seed = 0; seed < 40; ++seed) compare(this->at_a_corner(seed), {mid}, options);
  options.roi = {{3, 0, 31}, {50, 33, 64}};
  options.transform.spacing = {0.7, 1.3, -2};
  compare(this->coarse({67, 41, 75}, 2), {mid}, options);
}

TYPED_TEST(GpuResident, TheTrilinearInterpolantWithoutDegenerateTriangles) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  options.drop_degenerate = true;
  const double mid = this->lowest() + 100;
  compare(this->coarse({67, 41, 75}, 1), {mid, mid + 0.5, mid + 1}, options);
  compare(this->waves({131, 70, 97}), {mid - 40, mid}, options, 32);
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
    isobrick::Mesh mesh;
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
  isobrick::Mesh mesh;
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
  isobrick::Mesh once, again;
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
      isobrick::Mesh one, other;
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
    isobrick::Mesh expected;
    usual.download(expected);
    for (const gpu::LaunchShape& shape : all_shapes(lattice.type, options)) {
      SCOPED_TRACE(std::to_string(shape.threads) + " threads");
      gpu::ResidentExtractor extractor(volume, options, {.shape = &shape});
      extractor.extract(this->lowest() + 100);
      isobrick::Mesh mesh;
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
  SurfaceOptions local = good, nowhere = good;
  local.indexing = Indexing::chunk_local;
  nowhere.roi = {{1000, 0, 0}, {1001, 1, 1}};
  EXPECT_THROW(gpu::ResidentExtractor(volume, local), UsageError);
  EXPECT_THROW(gpu::ResidentExtractor(volume, nowhere), UsageError);
  gpu::ResidentExtractor extractor(volume, good);
  EXPECT_THROW(extractor.extract(std::nan("")), UsageError);
}

TYPED_TEST(GpuResident, DegenerateTrianglesOfMoreTilesThanTables) {
  SurfaceOptions options;
  options.drop_degenerate = true;
  compare(this->coarse({2, 1100, 1000}, 5, 3), {this->lowest() + 100}, options);
}

template <class T>
using GpuResidentWithNaN = DeviceTest<T>;

TYPED_TEST_SUITE(GpuResidentWithNaN, TypesWithNaN);

TYPED_TEST(GpuResidentWithNaN, IsTheMeshOfTheCpu) {
  SurfaceOptions options;
  options.may_have_nan = true;
  compare(this->waves({131, 70, 97}), {0, 30}, options);
  compare(with_nan(this->waves({131, 70, 97}), 1, 300), {0, -40}, options, 32);
  compare(with_nan(this->noise({67, 41, 75}, 2), 3, 20), {0}, options, 16);
  options.cap = true;
  for (const bool drop : {false, true}) {
    options.drop_degenerate = drop;
    compare(with_nan(this->coarse({67, 41, 75}, 2), 3, 300), {0}, options, 16);
  }
  compare(with_nan(this->noise({33, 32, 34}, 5), 4, 3), {0}, options);
  compare(with_nan(this->waves({3, 1030, 1060}), 5, 50), {0}, options);
}

TYPED_TEST(GpuResidentWithNaN, RegionsAndMirrors) {
  const auto field = with_nan(this->noise({67, 41, 75}, 7), 8, 15);
  for (const Box3 roi : {Box3{{5, 3, 7}, {60, 40, 70}}, Box3{{33, 0, 31}, {66, 39, 75}},
                         Box3{{31, 31, 31}, {34, 34, 34}}}) {
    SurfaceOptions options;
    options.may_have_nan = true;
    options.roi = roi;
    options.transform.spacing = {-1, 2, 1};
    compare(field, {0}, options);
  }
}

/// Samples that float cannot tell apart.
TEST(GpuResidentOf, WideSamplesAreInterpolatedInDouble) {
  if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  compare(wide_field<std::uint32_t>(), {kWideIsovalue}, {});
  compare(wide_field<std::int32_t>(), {kWideIsovalue}, {});
  compare(wide_field<double>(), {kWideIsovalue, kWideIsovalue + 0.25}, {});
}

TYPED_TEST(GpuResident, IsovaluesBeyondTheRangeGiveNothing) {
  compare(this->waves({67, 41, 75}), {-1e9, 1e9}, {});
}

}  // namespace
}  // namespace isobrick::testing

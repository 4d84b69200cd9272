#include <gtest/gtest.h>

#include "tests/gpu/kernels/kernel_volume.h"

// The extraction kernel makes the CPU's mesh, byte for byte, whichever of its threads comes first.

namespace isobrick::testing {
namespace {

using emulated::TileRun;

/// Searches the tiles and extracts the active ones.
template <class T>
void run_both(const KernelVolume<T>& volume, const TileRun& run, double isovalue,
              KernelState& state, MeshRoom& room) {
  gpu::SearchParams search = volume.search_params(isovalue);
  state.give(search);
  emulated::run_search(run.type, search, run.seed);
  gpu::TileParams p = volume.params(isovalue);
  state.give(p);
  room.give(p);
  emulated::run_tiles(run, p, volume.cases());
}

template <class T>
void compare(const KernelVolume<T>& volume, TileRun run, const std::vector<double>& isovalues) {
  run.type = scalar_type_of<T>;
  run.normals = volume.options.normals;
  run.may_have_nan = volume.options.may_have_nan;
  run.on_samples = gpu::has_samples(volume.options);
  run.trilinear = volume.options.topology == Topology::trilinear;
  KernelState state(volume.tiles(), volume.grid_tiles());
  std::size_t made = 0;
  for (const double isovalue : isovalues) {
    SCOPED_TRACE("isovalue " + std::to_string(isovalue) + ", " + std::to_string(run.threads) +
                 " threads, " + (run.normals ? "normals, " : "") + "seed " +
                 std::to_string(run.seed));
    const isobrick::Mesh expected = volume.mesh(isovalue);
    MeshRoom room(expected.positions.size(), expected.triangles.size());
    run_both(volume, run, isovalue, state, room);
    room.expect(expected);
    state.expect_reported(expected, run.on_samples ? volume.left_out(isovalue) : 0);
    state.expect_zeroed();
    ++run.seed;
    made += expected.triangles.size();
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(made, 0u);
}

/// With normals and without where there are kernels for both.
template <class T>
void compare(const Field<T>& field, const TileRun& run, const std::vector<double>& isovalues,
             SurfaceOptions options = {}) {
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<T>};
  const DenseBricks bricks(lattice, field.samples.data());
  for (const bool normals : {false, true}) {
    if (normals && run.threads != 384) continue;
    options.normals = normals;
    compare(KernelVolume<T>(field, bricks, lattice, options), run, isovalues);
  }
}

template <class T>
class TileKernel : public ::testing::Test {
 protected:
  using Fields = TestFields<T>;
  static constexpr double kMid = TestFields<T>::lowest() + 100;
};

TYPED_TEST_SUITE(TileKernel, KernelTypes);

TYPED_TEST(TileKernel, RangesAndColumns) {
  for (const Int3 extent : {Int3{40, 35, 1}, Int3{33, 2, 67}}) {
    const auto field = TestFixture::Fields::noise(extent, 3);
    const Lattice lattice{extent, {64, 64, 64}, scalar_type_of<TypeParam>};
    const DenseBricks bricks(lattice, field.samples.data());
    KernelVolume<TypeParam>(field, bricks, lattice, {}).expect_ranges_and_columns();
  }
}

TYPED_TEST(TileKernel, SmoothFieldOfOddExtents) {
  constexpr double mid = TestFixture::kMid;
  compare(TestFixture::Fields::waves({67, 41, 40}), {}, {mid - 40, mid, mid + 0.5, mid + 90});
}

TYPED_TEST(TileKernel, NoiseIsTheHardestInput) {
  compare(TestFixture::Fields::noise({37, 41, 35}, 1), {}, {TestFixture::kMid});
  compare(TestFixture::Fields::noise({64, 33, 9}, 2), {.blocks = 3}, {TestFixture::kMid - 90});
}

TYPED_TEST(TileKernel, OneTile) {
  compare(TestFixture::Fields::noise({33, 33, 33}, 4), {.blocks = 1}, {TestFixture::kMid});
}

TYPED_TEST(TileKernel, ExtentsThatFillNoTile) {
  for (const Int3 extent : {Int3{2, 2, 2}, Int3{34, 5, 3}, Int3{5, 3, 97}}) {
    const Field<TypeParam> field(extent, [](Int3 p) {  // open at the border
      return TestFixture::kMid + static_cast<double>((p.x * 31 + p.y * 57 + p.z * 13) % 90 - 40);
    });
    compare(field, {}, {TestFixture::kMid});
  }
}

TYPED_TEST(TileKernel, RegionOfInterestAndTransform) {
  SurfaceOptions options;
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  options.transform.origin = {-5, 11, 0.25};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  for (const Inside inside : {Inside::above, Inside::below}) {
    options.inside = inside;
    compare(TestFixture::Fields::noise({55, 35, 44}, 5), {}, {TestFixture::kMid}, options);
  }
}

/// What has no room is not written, but counted and reported.
TYPED_TEST(TileKernel, TooLittleRoom) {
  const auto field = TestFixture::Fields::waves({67, 41, 40});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  const KernelVolume<TypeParam> volume(field, bricks, lattice, {});
  const isobrick::Mesh expected = volume.mesh(TestFixture::kMid);
  for (const auto& [vertices, triangles] : {std::pair<std::size_t, std::size_t>{0, 0},
                                            {expected.positions.size() - 1, 0},
                                            {0, expected.triangles.size() - 1}}) {
    KernelState state(volume.tiles(), volume.grid_tiles());
    MeshRoom room(vertices, triangles);
    run_both(volume, {.type = scalar_type_of<TypeParam>}, TestFixture::kMid, state, room);
    room.expect_untouched(vertices, triangles);
    state.expect_reported(expected);
    state.expect_zeroed();
  }
}

TYPED_TEST(TileKernel, BricksThatAreAbsent) {
  const HoledField<TypeParam> holed(TestFixture::Fields::noise({80, 40, 70}, 9),
                                    static_cast<TypeParam>(TestFixture::kMid + 50));
  const SurfaceOptions options = holed.options(TestFixture::kMid);
  compare(KernelVolume<TypeParam>(holed.field, holed, holed.lattice, options), {},
          {TestFixture::kMid});
}

/// What is not loaded has a fill value that would show.
TYPED_TEST(TileKernel, APartOfTheVolume) {
  constexpr double mid = TestFixture::kMid;
  const auto field = TestFixture::Fields::waves({131, 67, 99});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  const std::vector<double> isovalues{mid + 84, mid + 88};
  for (const bool normals : {false, true})
    for (const double fill : {mid - 90, mid + 90}) {
      const SurfaceOptions options{.normals = normals, .fill_value = fill};
      const KernelVolume<TypeParam> volume(field, bricks, lattice, options, isovalues);
      EXPECT_LT(volume.tiles(), volume.grid_tiles() / 2);
      compare(volume, {}, isovalues);
    }
}

#if ISOBRICK_KERNELS == 900  // no part of it depends on that
/// 33 × 33 tiles, which two blocks search.
TEST(TileKernelOf, TilesThatSeveralBlocksSearch) {
  const auto value = [](Int3 p) {
    return (p.y / 40 + p.z / 30) % 47 == 20 ? static_cast<double>((p.x * 31 + p.y * 13) % 90) : 9.0;
  };
  SurfaceOptions part;
  part.roi = {{0, 31, 100}, {2, 500, 760}};
  const Int3 extent{2, 1030, 1027};
  const Field<std::uint8_t> field(extent, value);
  const Lattice lattice{extent, {64, 64, 64}, ScalarType::u8};
  const DenseBricks bricks(lattice, field.samples.data());
  for (const SurfaceOptions& options : {SurfaceOptions{}, part})
    compare(KernelVolume<std::uint8_t>(field, bricks, lattice, options), {.blocks = 3}, {50});
}
#endif

TEST(TileKernelOf, BlocksOfAnyNumberOfThreads) {
  for (const unsigned threads : {32u, 640u, 1024u}) {
    compare(TestFields<std::uint8_t>::noise({40, 35, 20}, 6), {.threads = threads}, {100});
    compare(TestFields<std::uint8_t>::waves({67, 41, 20}), {.threads = threads}, {100, 130});
  }
}

TYPED_TEST(TileKernel, DegenerateTrianglesAreLeftOut) {
  constexpr double mid = TestFixture::kMid;
  SurfaceOptions options;
  options.drop_degenerate = true;
  compare(TestFixture::Fields::coarse({37, 41, 35}, 1), {.blocks = 3}, {mid, mid + 1}, options);
  compare(TestFixture::Fields::coarse({67, 34, 9}, 2, 2), {}, {mid}, options);
  // Tiles with such vertices and without.
  compare(TestFixture::Fields::waves({67, 41, 40}), {}, {mid}, options);
}

TYPED_TEST(TileKernel, DegenerateTrianglesOfARegion) {
  SurfaceOptions options;
  options.drop_degenerate = true;
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  for (const Inside inside : {Inside::above, Inside::below}) {
    options.inside = inside;
    compare(TestFixture::Fields::coarse({55, 35, 44}, 5), {}, {TestFixture::kMid}, options);
  }
}

/// Where eight tiles meet, each of which may have the first triangle.
TEST(TileKernelOf, DegenerateTrianglesAtTheCornerOfEightTiles) {
  SurfaceOptions options;
  options.drop_degenerate = true;
  for (unsigned seed = 0; seed < 16; ++seed)
    compare(TestFields<std::int16_t>::at_a_corner(seed), {.seed = seed}, {0}, options);
}

TEST(TileKernelOf, DegenerateTrianglesBesideNaN) {
  SurfaceOptions options;
  options.drop_degenerate = options.may_have_nan = true;
  compare(with_nan(TestFields<float>::coarse({40, 50, 34}, 1), 2, 20), {}, {0}, options);
  compare(with_nan(TestFields<double>::coarse({33, 50, 34}, 1), 2, 5), {}, {1}, options);
}

TYPED_TEST(TileKernel, TheBorderIsCapped) {
  constexpr double mid = TestFixture::kMid;
  SurfaceOptions options;
  options.cap = true;
  const auto coarse = TestFixture::Fields::coarse({34, 35, 5}, 1);
  for (const auto& [inside, topology] :
       {std::pair{Inside::above, Topology::consistent}, {Inside::below, Topology::trilinear}}) {
    options.inside = inside;
    options.topology = topology;
    options.drop_degenerate = false;
    compare(TestFixture::Fields::waves({67, 34, 5}), {.blocks = 3}, {mid + 0.5}, options);
    options.drop_degenerate = true;
    compare(coarse, {}, {mid}, options);
  }
}

TYPED_TEST(TileKernel, TheCapOfARegion) {
  SurfaceOptions options;
  options.cap = options.drop_degenerate = true;
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  for (const Inside inside : {Inside::above, Inside::below}) {
    options.inside = inside;
    compare(TestFixture::Fields::coarse({55, 35, 44}, 5), {}, {TestFixture::kMid}, options);
  }
}

/// Nothing but the border, whether or not a sample reaches the isovalue.
TYPED_TEST(TileKernel, TheCapOfABox) {
  SurfaceOptions options;
  options.cap = true;
  const auto field = TestFixture::Fields::waves({40, 33, 2});
  const std::vector<double> below{TestFixture::Fields::lowest() - 1}, above{1e30};
  compare(field, {}, below, options);
  options.inside = Inside::below;
  compare(field, {}, above, options);
}

TEST(TileKernelOf, CapsAtTheCornerOfEightTiles) {
  SurfaceOptions options;
  options.cap = true;
  for (unsigned seed = 0; seed < 16; ++seed) {
    options.drop_degenerate = seed % 2 != 0;
    options.roi = {{seed % 3 == 0 ? 32 : 31, seed % 5 == 0 ? 32 : 0, 0}, {45, 40, 33}};
    compare(TestFields<std::int16_t>::at_a_corner(seed), {.seed = seed}, {0}, options);
  }
}

TEST(TileKernelOf, CapsBesideNaN) {
  SurfaceOptions options;
  options.cap = options.may_have_nan = true;
  for (const bool drop : {false, true})
    for (const Topology topology : {Topology::consistent, Topology::trilinear}) {
      options.drop_degenerate = drop;
      options.topology = topology;
      compare(with_nan(TestFields<float>::coarse({40, 50, 34}, 1), 2, 20), {}, {0}, options);
      compare(with_nan(TestFields<double>::coarse({33, 50, 34}, 1), 2, 300), {}, {1}, options);
    }
}

TYPED_TEST(TileKernel, TheTrilinearInterpolantWithoutDegenerateTriangles) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  options.drop_degenerate = true;
  constexpr double mid = TestFixture::kMid;
  compare(TestFixture::Fields::coarse({34, 35, 12}, 1), {.blocks = 3}, {mid, mid + 1}, options);
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  options.inside = Inside::below;
  compare(TestFixture::Fields::coarse({55, 35, 44}, 5), {}, {mid}, options);
}

TYPED_TEST(TileKernel, TheTrilinearInterpolantIsFollowed) {
  constexpr double mid = TestFixture::kMid;
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  compare(TestFixture::Fields::noise({37, 41, 35}, 1), {.blocks = 3}, {mid, mid + 1}, options);
  // Samples that equal the isovalue, and cells without a vertex of their tile's own.
  compare(TestFixture::Fields::coarse({67, 34, 9}, 2, 2), {}, {mid}, options);
  compare(TestFixture::Fields::waves({67, 41, 40}), {}, {mid}, options);
}

TYPED_TEST(TileKernel, TheTrilinearInterpolantOfARegion) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  for (const Inside inside : {Inside::above, Inside::below}) {
    options.inside = inside;
    compare(TestFixture::Fields::noise({55, 35, 44}, 5), {}, {TestFixture::kMid}, options);
  }
}

TEST(TileKernelOf, TheTrilinearInterpolantBesideNaN) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  options.may_have_nan = true;
  compare(with_nan(TestFields<float>::noise({40, 50, 34}, 1), 2, 20), {}, {0}, options);
  compare(with_nan(TestFields<double>::noise({33, 50, 34}, 1), 2, 5), {}, {1}, options);
}

TEST(TileKernelOf, NotANumber) {
  SurfaceOptions options;
  options.may_have_nan = true;
  compare(with_nan(TestFields<float>::waves({67, 41, 40}), 1, 300), {}, {0, -40}, options);
  compare(with_nan(TestFields<float>::noise({40, 50, 34}, 1), 2, 20), {}, {0}, options);
  compare(with_nan(TestFields<float>::noise({33, 32, 34}, 5), 4, 3), {}, {0}, options);
  compare(with_nan(TestFields<double>::noise({40, 50, 34}, 1), 2, 20), {}, {0}, options);
}

/// Samples that float cannot tell apart.
TEST(TileKernelOf, WideSamplesAreInterpolatedInDouble) {
  compare(wide_field<std::uint32_t>(), {}, {kWideIsovalue});
  compare(wide_field<std::int32_t>(), {}, {kWideIsovalue});
  compare(wide_field<double>(), {}, {kWideIsovalue, kWideIsovalue + 0.25});
}

}  // namespace
}  // namespace isobrick::testing

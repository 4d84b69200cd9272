#include <gtest/gtest.h>

#include "tests/gpu/kernels/kernel_volume.h"

// The extraction kernel makes the CPU's mesh, byte for byte, whichever of its threads comes first.

namespace isobrick::testing {
namespace {

using emulated::TileRun;

/// Extracts tiles that the host has found.
template <class T>
void compare(const KernelVolume<T>& volume, TileRun run, const std::vector<double>& isovalues) {
  run.type = scalar_type_of<T>;
  run.normals = volume.options.normals;
  run.may_have_nan = volume.options.may_have_nan;
  const bool in_slabs = run.threads == gpu::kSlabTeam;
  const std::uint32_t slabs = in_slabs ? gpu::kSlabsOfTile : 1;
  KernelState state(volume.tiles() * slabs);
  std::size_t made = 0;
  for (const double isovalue : isovalues) {
    SCOPED_TRACE("isovalue " + std::to_string(isovalue) + ", " + std::to_string(run.threads) +
                 " threads, " + (run.normals ? "normals, " : "") + "seed " +
                 std::to_string(run.seed));
    const MeshBuffer expected = volume.mesh(isovalue);
    const gpu::FoundTiles found = volume.find(isovalue);
    if (found.count == 0) {
      EXPECT_EQ(expected.positions.size(), 0u);
      continue;
    }
    gpu::TileParams p = volume.params(isovalue);
    p.found = found.count;
    if (in_slabs) {
      std::ranges::copy(found.tiles, p.found_tiles);
      run.blocks = found.count * slabs;
    } else {
      std::ranges::copy(found.words, p.found_words);
    }
    state.give(p, run.blocks == found.count * slabs);
    MeshRoom room(expected.positions.size(), expected.triangles.size());
    room.give(p);
    emulated::run_tiles(run, p, volume.cases());
    room.expect(expected);
    state.expect_told(expected, found.count);
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
  const bool both = run.threads == 384 || run.threads == gpu::kSlabTeam;
  for (const bool normals : {false, true}) {
    if (normals && !both) continue;
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

TYPED_TEST_SUITE(TileKernel, DeviceTypes);

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
  compare(TestFixture::Fields::noise({33, 33, 33}, 4), {.threads = gpu::kSlabTeam},
          {TestFixture::kMid});
}

TYPED_TEST(TileKernel, ExtentsThatFillNoTile) {
  for (const Int3 extent : {Int3{2, 2, 2}, Int3{34, 5, 3}, Int3{5, 3, 97}}) {
    const Field<TypeParam> field(extent, [](Int3 p) {  // open at the border
      return TestFixture::kMid + static_cast<double>((p.x * 31 + p.y * 57 + p.z * 13) % 90 - 40);
    });
    compare(field, {}, {TestFixture::kMid});
    compare(field, {.threads = gpu::kSlabTeam}, {TestFixture::kMid});
  }
}

TYPED_TEST(TileKernel, Slabs) {
  constexpr double mid = TestFixture::kMid;
  const TileRun run{.threads = gpu::kSlabTeam};
  compare(TestFixture::Fields::waves({33, 30, 60}), run, {mid - 40, mid, mid + 0.5});
  compare(TestFixture::Fields::noise({40, 20, 35}, 11), run, {mid});
  compare(TestFixture::Fields::noise({33, 49, 17}, 12), run, {mid});
}

TYPED_TEST(TileKernel, RegionOfInterestAndTransform) {
  SurfaceOptions options;
  options.roi = {{3, 0, 31}, {50, 33, 40}};
  options.transform.spacing = {0.7, 1.3, -2};
  options.transform.origin = {-5, 11, 0.25};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  for (const unsigned threads : {384u, unsigned{gpu::kSlabTeam}})
    for (const Inside inside : {Inside::above, Inside::below}) {
      options.inside = inside;
      compare(TestFixture::Fields::noise({55, 35, 44}, 5), {.threads = threads},
              {TestFixture::kMid}, options);
    }
}

/// What has no room is not written, and what there would be is told.
TYPED_TEST(TileKernel, TooLittleRoom) {
  const auto field = TestFixture::Fields::waves({67, 41, 40});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  const KernelVolume<TypeParam> volume(field, bricks, lattice, {});
  const MeshBuffer expected = volume.mesh(TestFixture::kMid);
  const gpu::FoundTiles found = volume.find(TestFixture::kMid);
  for (const auto& [vertices, triangles] : {std::pair<std::size_t, std::size_t>{0, 0},
                                            {expected.positions.size() - 1, 0},
                                            {0, expected.triangles.size() - 1}}) {
    gpu::TileParams p = volume.params(TestFixture::kMid);
    p.found = found.count;
    std::ranges::copy(found.words, p.found_words);
    KernelState state(volume.tiles());
    state.give(p, false);
    MeshRoom room(vertices, triangles);
    room.give(p);
    emulated::run_tiles({.type = scalar_type_of<TypeParam>}, p, volume.cases());
    room.expect_untouched(vertices, triangles);
    state.expect_told(expected, found.count);
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

/// Active tiles that a launch before has found.
template <class T>
void compare_searched(const Field<T>& field, SurfaceOptions options, double isovalue) {
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<T>};
  const DenseBricks bricks(lattice, field.samples.data());
  const KernelVolume<T> volume(field, bricks, lattice, options);
  const MeshBuffer expected = volume.mesh(isovalue);
  std::vector<gpu::TileItem> items(volume.tiles());
  std::vector<std::uint32_t> slots(volume.tiles());
  std::vector<unsigned long long> sums(2);
  std::uint32_t count = 0, ticket = 0;
  KernelState state(volume.tiles());
  gpu::TileParams p = volume.params(isovalue);
  p.candidates.count = 0;
  state.give(p, false);
  gpu::SearchParams search = volume.search_params(isovalue);
  search.items = items.data();
  search.found = &state.found;
  search.item_count = &count;
  search.item_room = volume.tiles();
  search.slot_of_tile = slots.data();
  search.order = p.order;
  search.sums = sums.data();
  search.ticket = &ticket;
  emulated::run_search(scalar_type_of<T>, search, 1);
  EXPECT_EQ(count, volume.find(isovalue).count);
  p.items = items.data();
  p.item_count = &count;
  p.slot_of_tile = slots.data();
  p.begin_at_once = 1;
  MeshRoom room(expected.positions.size(), expected.triangles.size());
  room.give(p);
  emulated::run_tiles({.type = scalar_type_of<T>, .blocks = 3}, p, volume.cases());
  room.expect(expected);
  state.expect_told(expected, count);
  state.expect_zeroed();
}

/// 33 × 33 tiles, which two blocks search.
TEST(TileKernelOf, TilesThatALaunchBeforeHasFound) {
  const auto value = [](Int3 p) {
    return (p.y / 40 + p.z / 30) % 23 == 0 ? static_cast<double>((p.x * 31 + p.y * 13) % 90) : 9.0;
  };
  SurfaceOptions part;
  part.roi = {{0, 31, 100}, {2, 500, 760}};
  const Int3 extent{2, 1030, 1027};
  compare_searched(Field<std::uint8_t>(extent, value), {}, 50);
  compare_searched(Field<std::uint8_t>(extent, value), part, 50);
  compare_searched(Field<float>(extent, value), {}, 80.5);
}

TEST(TileKernelOf, TeamsOfAnyNumberOfThreads) {
  for (const unsigned threads : {32u, 640u, 1024u}) {
    compare(TestFields<std::uint8_t>::noise({40, 35, 20}, 6), {.threads = threads}, {100});
    compare(TestFields<std::uint8_t>::waves({67, 41, 20}), {.threads = threads}, {100, 130});
  }
}

TEST(TileKernelOf, NotANumber) {
  SurfaceOptions options;
  options.may_have_nan = true;
  compare(with_nan(TestFields<float>::waves({67, 41, 40}), 1, 300), {}, {0, -40}, options);
  compare(with_nan(TestFields<float>::noise({40, 50, 34}, 1), 2, 20), {}, {0}, options);
  compare(with_nan(TestFields<float>::noise({33, 32, 34}, 5), 4, 3), {}, {0}, options);
}

}  // namespace
}  // namespace isobrick::testing

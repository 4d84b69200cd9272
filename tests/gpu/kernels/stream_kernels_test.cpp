#include <gtest/gtest.h>

#include "gpu/stream/brick_table.h"
#include "gpu/stream/row_slots.h"
#include "gpu/tile/block_groups.h"
#include "tests/gpu/kernels/kernel_volume.h"

// Tiles that stream through a device, launch after launch: unpacked from their bricks, extracted,
// and linked to those of launches before. The host's side is GpuExtractor's.

namespace isobrick::testing {
namespace {

template <class T>
class Streamed {
 public:
  Streamed(const Lattice& lattice, const BrickLookup& bricks, const SurfaceOptions& options)
      : lattice_(lattice),
        bricks_(bricks),
        options_(options),
        slots_(kSlots, lattice.tiles()),
        row_tables_(kSlots),
        sample_tables_(kSlots),
        work_(3),
        cases_(gpu::make_case_table(world_map(options.transform, options.inside).mirrored)),
        tile_bricks_(static_cast<std::uint32_t>(max_bricks_of_tile(lattice, reach()))) {}

  /// Appends the mesh of some tiles, which come after all before; with `only_counts` just numbers
  /// their vertices.
  void extract(std::span<const TileWork> tiles, MeshRoom& room, bool only_counts = false) {
    count_ = static_cast<std::uint32_t>(tiles.size());
    find_bricks(tiles);
    link_all(tiles);
    unpack();
    gpu::TileParams p = params();
    room.give(p);
    p.positions += vertices_ - before_;
    p.normals += vertices_ - before_;
    p.triangles += triangles_;
    p.vertex_capacity -= vertices_ - before_;
    p.triangle_capacity -= triangles_;
    if (only_counts) p.vertex_capacity = p.triangle_capacity = 0;
    std::uint32_t ticket = 0;
    gpu::SurfaceTotals totals{};
    std::vector<gpu::OrderState> order(tiles.size());
    const unsigned long long start = vertices_;
    unsigned long long end = 0;
    p.ticket = &ticket;
    p.totals = &totals;
    p.order = order.data();
    p.number_start = &start;
    p.number_end = &end;
    p.on_samples = gpu::sample_params(lattice_.type, options_);
    p.on_samples.work = work_.data();
    p.on_samples.tables = sample_tables_.data();
    p.on_samples.neighbours = neighbours_.data();
    p.on_samples.left_out = &totals.left_out;
    p.trilinear = {trilinear_work_.data(), &topology_tables()};
    emulated::run_tiles({.type = lattice_.type,
                         .normals = options_.normals,
                         .may_have_nan = options_.may_have_nan,
                         .on_samples = gpu::has_samples(options_),
                         .trilinear = options_.topology == Topology::trilinear,
                         .blocks = std::min(3u, count_),
                         .seed = ++epoch_},
                        p, cases_);
    slots_.recycle(unused_);
    vertices_ += totals.vertices;
    if (only_counts)
      before_ += totals.vertices;
    else
      triangles_ += totals.triangles;
    left_out_ += totals.left_out;
    EXPECT_EQ(end, vertices_);
  }

  std::uint64_t vertices() const { return vertices_; }
  std::uint64_t triangles() const { return triangles_; }
  std::uint64_t left_out() const { return left_out_; }

 private:
  static constexpr std::uint32_t kSlots = 200;

  Index reach() const { return sample_reach(options_); }

  void find_bricks(std::span<const TileWork> tiles) {
    constexpr std::size_t kPlaces = 3;  // others are read where they lie
    boxes_.assign(count_, {});
    addresses_.assign(std::size_t{count_} * tile_bricks_, 0);
    sent_.resize(kPlaces * lattice_.brick_bytes());
    const gpu::BrickUse use = gpu::use_bricks(lattice_, reach(), tiles, bricks_, kPlaces,
                                              sent_.data(), {boxes_, addresses_});
    for (std::size_t i = 0; i < use.sent.size(); ++i)
      std::memcpy(sent_.data() + i * lattice_.brick_bytes(), use.sent[i].from,
                  lattice_.brick_bytes());
  }

  void link_all(std::span<const TileWork> tiles) {
    items_.resize(count_);
    links_.resize(count_);
    neighbours_.resize(count_);
    const Int3 lo = options_.roi.lo, first{lo.x / 32, lo.y / 32, lo.z / 32};
    for (std::uint32_t i = 0; i < count_; ++i) {
      const Int3 t = tiles[i].tile;
      links_[i].active_blocks = tiles[i].active_blocks;
      for (int n = 1; n <= 6; ++n) {
        const Int3 step{n & 1, n >> 1 & 1, n >> 2};
        const bool exists = (step.x == 0 || t.x > first.x) && (step.y == 0 || t.y > first.y) &&
                            (step.z == 0 || t.z > first.z);
        links_[i].before[n - 1] = exists ? slots_.find(t - step) : gpu::kNone;
      }
      slots_.find_around(t, neighbours_[i]);
      items_[i] = {static_cast<std::int32_t>(t.x), static_cast<std::int32_t>(t.y),
                   static_cast<std::int32_t>(t.z), slots_.add(t)};
    }
    slots_.end_launch(tiles.back().tile, unused_);
  }

  void unpack() {
    const std::size_t groups = (count_ + gpu::kTilesOfBlockGroup - 1) / gpu::kTilesOfBlockGroup;
    tile_blocks_.assign(groups * gpu::kBlockGroupSamples, T{93});  // of launches before
    gpu::UnpackParams u{};
    u.items = items_.data();
    u.links = links_.data();
    u.count = count_;
    u.boxes = boxes_.data();
    u.bricks = addresses_.data();
    u.tile_bricks = tile_bricks_;
    u.reach = static_cast<int>(reach());
    u.corners = options_.may_have_nan || gpu::has_samples(options_);
    for (int axis = 0; axis < 3; ++axis) {
      u.brick[axis] = static_cast<std::int32_t>(lattice_.brick[axis]);
      u.extent[axis] = static_cast<std::int32_t>(lattice_.extent[axis]);
    }
    u.fill_value = options_.fill_value;
    u.tile_blocks = tile_blocks_.data();
    emulated::run_unpack(lattice_.type, u, epoch_);
  }

  gpu::TileParams params() {
    gpu::TileParams p = params_of(lattice_, options_);
    p.items = items_.data();
    p.item_count = &count_;
    p.links = links_.data();
    p.tile_blocks = tile_blocks_.data();
    p.epoch = epoch_ + 1;
    p.row_tables = row_tables_.data();
    return p;
  }

  Lattice lattice_;
  const BrickLookup& bricks_;
  SurfaceOptions options_;
  gpu::RowSlots slots_;
  std::vector<gpu::RowTable> row_tables_;
  std::vector<gpu::SampleTable> sample_tables_;
  std::vector<gpu::SampleWork> work_;
  std::vector<gpu::TrilinearWork> trilinear_work_ = std::vector<gpu::TrilinearWork>(3);
  gpu::CaseTable cases_;
  std::uint32_t tile_bricks_, count_ = 0, epoch_ = 0;
  std::uint64_t vertices_ = 0, triangles_ = 0, left_out_ = 0;
  std::uint64_t before_ = 0;  ///< vertices that are numbered only
  std::vector<gpu::BrickBox> boxes_;
  std::vector<std::uint64_t> addresses_;
  std::vector<std::byte> sent_;
  std::vector<gpu::TileItem> items_;
  std::vector<gpu::TileLinks> links_;
  std::vector<gpu::TileNeighbours> neighbours_;
  std::vector<std::uint32_t> unused_;
  std::vector<T> tile_blocks_;
};

/// In launches of so many tiles.
template <class T>
void compare(const Field<T>& field, const Lattice& lattice, const BrickLookup& bricks,
             SurfaceOptions options, std::size_t tiles_of_launch) {
  if (options.roi == Box3{}) options.roi = lattice.box();
  for (const bool normals : {false, true}) {
    SCOPED_TRACE(std::to_string(tiles_of_launch) + " tiles a launch" +
                 (normals ? ", normals" : ""));
    options.normals = normals;
    const isobrick::Mesh expected =
        expected_mesh(field, lattice, bricks, options, options.isovalue);
    ASSERT_GT(expected.triangles.size(), 0u);
    std::vector<TileWork> tiles = tiles_of(field, options);
    if (options.may_have_nan)
      for (TileWork& tile : tiles) tile.active_blocks = 0xff;
    MeshRoom room(expected.positions.size(), expected.triangles.size());
    Streamed<T> streamed(lattice, bricks, options);
    for (std::size_t i = 0; i < tiles.size(); i += tiles_of_launch)
      streamed.extract(std::span(tiles).subspan(i, std::min(tiles_of_launch, tiles.size() - i)),
                       room);
    room.expect(expected);
    EXPECT_EQ(streamed.vertices(), expected.positions.size());
    EXPECT_EQ(streamed.triangles(), expected.triangles.size());
    EXPECT_EQ(streamed.left_out(), left_out_on_cpu(field, lattice, bricks, options));
  }
}

template <class T>
class StreamKernels : public ::testing::Test {
 protected:
  static constexpr double kMid = TestFields<T>::lowest() + 100;

  static void compare_waves(Int3 brick, std::size_t tiles_of_launch) {
    const auto field = TestFields<T>::waves({67, 41, 70});
    const Lattice lattice{field.extent, brick, scalar_type_of<T>};
    const DenseBricks bricks(lattice, field.samples.data());
    SurfaceOptions options;
    options.isovalue = kMid;
    compare(field, lattice, bricks, options, tiles_of_launch);
  }
};

TYPED_TEST_SUITE(StreamKernels, KernelTypes);

TYPED_TEST(StreamKernels, LaunchesOfAnyNumberOfTiles) {
  this->compare_waves({64, 64, 64}, 1);
  this->compare_waves({16, 40, 23}, 5);
  this->compare_waves({32, 32, 32}, 100);
}

TYPED_TEST(StreamKernels, RegionOfInterest) {
  const auto field = TestFields<TypeParam>::noise({70, 40, 45}, 5);
  const Lattice lattice{field.extent, {32, 32, 32}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  options.isovalue = TestFixture::kMid;
  options.roi = {{20, 3, 31}, {69, 36, 40}};
  for (const Inside inside : {Inside::above, Inside::below}) {
    options.inside = inside;
    compare(field, lattice, bricks, options, 3);
  }
}

TYPED_TEST(StreamKernels, BricksThatAreAbsent) {
  const HoledField<TypeParam> holed(TestFields<TypeParam>::noise({80, 34, 40}, 9),
                                    static_cast<TypeParam>(TestFixture::kMid + 50));
  compare(holed.field, holed.lattice, holed, holed.options(TestFixture::kMid), 4);
}

TYPED_TEST(StreamKernels, DegenerateTrianglesAreLeftOut) {
  SurfaceOptions options;
  options.isovalue = TestFixture::kMid;
  options.drop_degenerate = true;
  const auto compare_field = [&](const Field<TypeParam>& field, std::size_t tiles_of_launch) {
    const Lattice lattice{field.extent, {16, 40, 23}, scalar_type_of<TypeParam>};
    compare(field, lattice, DenseBricks(lattice, field.samples.data()), options, tiles_of_launch);
  };
  const auto coarse = TestFields<TypeParam>::coarse({67, 41, 70}, 7);
  for (const std::size_t tiles : {1u, 100u}) compare_field(coarse, tiles);
  compare_field(TestFields<TypeParam>::at_a_corner(6), 3);
}

TYPED_TEST(StreamKernels, TheTrilinearInterpolantIsFollowed) {
  SurfaceOptions options;
  options.isovalue = TestFixture::kMid;
  options.topology = Topology::trilinear;
  const auto compare_field = [&](const Field<TypeParam>& field, std::size_t tiles_of_launch) {
    const Lattice lattice{field.extent, {16, 40, 23}, scalar_type_of<TypeParam>};
    compare(field, lattice, DenseBricks(lattice, field.samples.data()), options, tiles_of_launch);
  };
  compare_field(TestFields<TypeParam>::noise({67, 41, 40}, 7), 3);
  compare_field(TestFields<TypeParam>::coarse({40, 34, 40}, 7), 100);
}

TYPED_TEST(StreamKernels, TheBorderIsCapped) {
  SurfaceOptions options;
  options.isovalue = TestFixture::kMid;
  options.cap = true;
  const auto coarse = TestFields<TypeParam>::coarse({40, 34, 35}, 7);
  const Lattice lattice{coarse.extent, {16, 40, 23}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, coarse.samples.data());
  compare(coarse, lattice, bricks, options, 100);
  options.drop_degenerate = true;
  options.topology = Topology::trilinear;
  options.inside = Inside::below;
  compare(coarse, lattice, bricks, options, 3);
}

struct NoPlaces final : TilePlaces {
  void place(const TilePlace&) override {}
};

/// Tiles before the part that it needs are counted, and lack those before them.
TYPED_TEST(StreamKernels, APartOfTheTiles) {
  const auto field = TestFields<TypeParam>::coarse({161, 41, 41}, 7);
  const Lattice lattice{field.extent, {16, 40, 23}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  struct Kind {
    bool drop, cap;
    Topology topology;
  };
  for (const auto& [drop, cap, topology] : {Kind{false, false, Topology::consistent},
                                            {true, false, Topology::consistent},
                                            {false, false, Topology::trilinear},
                                            {true, true, Topology::trilinear}})
    for (const std::uint64_t begin : {1u, 64u}) {  // tiles (1, 0, 0) and (4, 0, 0)
      SurfaceOptions options;
      options.topology = topology;
      options.isovalue = TestFixture::kMid;
      options.roi = lattice.box();
      options.drop_degenerate = drop;
      options.cap = cap;
      const TileRange part{begin, begin + 4, drop || cap, lattice.tiles()};
      std::vector<TileWork> tiles = tiles_of(field, options);
      std::erase_if(tiles, [&](const TileWork& work) { return !part.needs(work.tile); });
      const auto own = std::ranges::find_if(
          tiles, [&](const TileWork& work) { return part.contains(work.tile); });
      NoPlaces places;
      CpuExtractor cpu(lattice, options, {});
      cpu.make_part(part, places);
      tbb::task_arena(1).execute([&] { cpu.extract(tiles, bricks, nullptr); });
      MeshRoom room(cpu.mesh().positions.size(), cpu.mesh().triangles.size());
      Streamed<TypeParam> streamed(lattice, bricks, options);
      if (own != tiles.begin()) streamed.extract({tiles.begin(), own}, room, true);
      streamed.extract({own, tiles.end()}, room);
      room.expect(cpu.mesh());
    }
}

TEST(StreamKernelsOf, NotANumber) {
  const auto field = with_nan(TestFields<float>::waves({67, 41, 40}), 1, 300);
  const Lattice lattice{field.extent, {32, 32, 32}, ScalarType::f32};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  options.isovalue = 0;
  options.may_have_nan = true;
  compare(field, lattice, bricks, options, 3);
}

}  // namespace
}  // namespace isobrick::testing

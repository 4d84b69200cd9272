#pragma once

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "core/morton.h"
#include "gpu/resident/resident_sizes.h"
#include "gpu/tile/on_samples.h"
#include "gpu/tile/tile_block.h"
#include "surface/surface_extractor.h"
#include "surface/topology_tables.h"
#include "surface/world_map.h"
#include "tests/gpu/compare.h"
#include "tests/gpu/kernels/tile_runner.h"

namespace isobrick::testing {

/// One type of each kind: these kernels run slowly. What depends on the architecture does not
/// depend on the type.
#if ISOBRICK_KERNELS == 900
using KernelTypes =
    ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, float, double>;
#else
using KernelTypes = ::testing::Types<std::uint8_t, float>;
#endif

/// The CPU's mesh, with one thread: ThreadSanitizer does not know what TBB does.
template <class T>
isobrick::Mesh expected_mesh(const Field<T>& field, const Lattice& lattice,
                             const BrickLookup& bricks, SurfaceOptions options, double isovalue) {
  options.isovalue = isovalue;
  return tbb::task_arena(1).execute([&] { return on_cpu(field, lattice, bricks, options); });
}

/// Where a kernel leaves a mesh, and some room behind it that stays as it is.
struct MeshRoom {
  static constexpr std::size_t kBehind = 64;
  static constexpr float kUntouched = -12345.0f;
  std::vector<Vec3f> positions, normals;
  std::vector<Triangle> triangles;

  MeshRoom(std::size_t vertices, std::size_t all_triangles)
      : positions(vertices + kBehind, {kUntouched, kUntouched, kUntouched}),
        normals(positions),
        triangles(all_triangles + kBehind, {gpu::kNone, gpu::kNone, gpu::kNone}) {}

  void give(gpu::TileParams& p) {
    p.positions = positions.data();
    p.normals = normals.data();
    p.triangles = triangles.data();
    p.vertex_capacity = positions.size() - kBehind;
    p.triangle_capacity = triangles.size() - kBehind;
  }
  /// The first of what is there.
  void expect(const isobrick::Mesh& mesh) const {
    expect_begins_with(mesh);
    expect_untouched(mesh.positions.size(), mesh.triangles.size());
  }
  /// The same where there may be larger ones of before behind it.
  void expect_begins_with(const isobrick::Mesh& mesh) const {
    expect_first("positions", mesh.positions, positions);
    expect_first("normals", mesh.normals, normals);
    expect_first("triangles", mesh.triangles, triangles);
    expect_untouched(positions.size() - kBehind, triangles.size() - kBehind);
  }
  /// From there on.
  void expect_untouched(std::size_t vertex, std::size_t triangle) const {
    for (std::size_t i = vertex; i < positions.size(); ++i) {
      ASSERT_EQ(positions[i].x, kUntouched) << i << " of " << vertex;
      ASSERT_EQ(normals[i].x, kUntouched) << i << " of " << vertex;
    }
    for (std::size_t i = triangle; i < triangles.size(); ++i)
      ASSERT_EQ(triangles[i][0], gpu::kNone) << i << " of " << triangle;
  }

 private:
  template <class V>
  static void expect_first(const char* what, const PodBuffer<V>& mesh, const std::vector<V>& room) {
    ASSERT_LE(mesh.size(), room.size()) << what;
    for (std::size_t i = 0; i < mesh.size(); ++i)
      ASSERT_EQ(std::memcmp(&mesh[i], &room[i], sizeof(V)), 0)
          << what << ": first difference at " << i << " of " << mesh.size();
  }
};

/// The lattice and the surface of an extraction, wherever the samples lie.
inline gpu::TileParams params_of(const Lattice& lattice, const SurfaceOptions& options) {
  gpu::TileParams p{};
  for (int axis = 0; axis < 3; ++axis) {
    p.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
    p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
    p.roi_lo[axis] = static_cast<std::int32_t>(options.roi.lo[axis]);
    p.roi_hi[axis] = static_cast<std::int32_t>(options.roi.hi[axis]);
  }
  p.isovalue = options.isovalue;
  p.world = world_map(options.transform, options.inside);
  p.diagonal = is_diagonal(p.world);
  return p;
}

/// A small volume as kernels find it on a device; DeviceVolume does the same there.
template <class T>
class KernelVolume {
 public:
  Lattice lattice;
  SurfaceOptions options;

  /// Keeps `field` and `bricks`. The region of interest is all where `o` leaves it empty. Only
  /// tiles that are active at one of `isovalues` are searched, all where there are none.
  KernelVolume(const Field<T>& field, const BrickLookup& bricks, const Lattice& l,
               const SurfaceOptions& o, const std::vector<double>& isovalues = {})
      : lattice(l), options(o), field_(field), bricks_(bricks) {
    if (options.roi == Box3{}) options.roi = lattice.box();
    std::vector<char> is_searched(grid_tiles(), isovalues.empty());
    for (const double isovalue : isovalues)
      for (const TileWork& work : active_tiles(field, isovalue))
        is_searched[static_cast<std::size_t>(linear_index(work.tile, lattice.tiles()))] = 1;
    for_each_morton(lattice.tiles(), [&](Int3 t) {
      if (is_searched[static_cast<std::size_t>(linear_index(t, lattice.tiles()))])
        tiles_.push_back(t);
    });
    make_pages();
    list_tiles();
    cases_ = gpu::make_case_table(world_map(options.transform, options.inside).mirrored);
  }

  std::uint32_t tiles() const { return static_cast<std::uint32_t>(tiles_.size()); }
  std::size_t grid_tiles() const { return static_cast<std::size_t>(volume(lattice.tiles())); }
  const gpu::CaseTable& cases() const { return cases_; }
  isobrick::Mesh mesh(double isovalue) const {
    return expected_mesh(field_, lattice, bricks_, options, isovalue);
  }
  /// Degenerate triangles.
  std::uint64_t left_out(double isovalue) const {
    SurfaceOptions o = options;
    o.isovalue = isovalue;
    return tbb::task_arena(1).execute([&] { return left_out_on_cpu(field_, lattice, bricks_, o); });
  }

  /// What the search for active tiles is given.
  gpu::SearchParams search_params(double isovalue) const {
    gpu::SearchParams p{};
    p.uncut = options.roi == lattice.box();
    p.tiles = coordinates_.data();
    p.ranges = ranges_.data();
    p.count = tiles();
    const gpu::TileParams t = params(isovalue);
    std::ranges::copy(t.tiles, p.grid);
    std::ranges::copy(t.roi_lo, p.roi_lo);
    std::ranges::copy(t.roi_hi, p.roi_hi);
    p.isovalue = isovalue;
    p.cap = options.cap;
    p.below = options.inside == Inside::below;
    p.everywhere = options.may_have_nan;
    return p;
  }

  /// What an extraction is given of the volume.
  gpu::TileParams params(double isovalue) const {
    SurfaceOptions o = options;
    o.isovalue = isovalue;
    gpu::TileParams p = params_of(lattice, o);
    p.on_samples = gpu::sample_params(lattice.type, o);
    p.tile_blocks = tile_blocks_.data();
    p.columns = columns_.data();
    p.block_of_tile = block_of_tile_.data();
    return p;
  }

  /// What kernels have found, by definition.
  void expect_ranges_and_columns() const {
    for (std::size_t i = 0; i < tiles(); ++i) {
      ValueRange<T> range;
      for_each_point(samples_of(tiles_[i]), [&](Int3 p) { range.include(field_.at(p)); });
      EXPECT_EQ(range.lo, ranges_[2 * i]) << "tile " << i;
      EXPECT_EQ(range.hi, ranges_[2 * i + 1]) << "tile " << i;
    }
    for (std::size_t i = 0; i < columns_.size(); ++i)
      ASSERT_EQ(std::memcmp(&columns_[i], &tile_blocks_[32 * i], sizeof(T)), 0) << "row " << i;
  }

 private:
  Box3 samples_of(Int3 tile) const {
    const Int3 lo = tile * Index{32};
    return intersect({lo, lo + Int3{33, 33, 33}}, lattice.box());
  }
  void make_pages() {
    const Int3 grid = lattice.tiles();
    const std::vector<Int3> loaded = gpu::tiles_to_load(lattice, tiles_, sample_reach(options));
    tile_blocks_.resize((loaded.size() + 1) * gpu::kTileBlockSamples);
    gpu::fill_tile_block(lattice.type, options.fill_value, block(0));
    block_of_tile_.assign(grid_tiles(), gpu::kNone);
    for (std::uint32_t i = 0; i < loaded.size(); ++i)
      if (gpu::gather_tile_block(lattice, bricks_, options.fill_value, loaded[i], block(i + 1)))
        block_of_tile_[static_cast<std::size_t>(linear_index(loaded[i], grid))] = i + 1;
    const auto blocks = static_cast<std::uint32_t>(loaded.size() + 1);
    columns_.resize(blocks * gpu::kColumnSamples);
    emulated::run_first_columns(lattice.type, tile_blocks_.data(), blocks, columns_.data());
  }
  std::byte* block(std::size_t i) {
    return reinterpret_cast<std::byte*>(tile_blocks_.data() + i * gpu::kTileBlockSamples);
  }
  void list_tiles() {
    for (const Int3 tile : tiles_)
      for (int axis = 0; axis < 3; ++axis)
        coordinates_.push_back(static_cast<std::int32_t>(tile[axis]));
    ranges_.resize(2 * std::size_t{tiles()});
    emulated::run_tile_ranges(lattice.type, params(0), coordinates_.data(), tiles(),
                              ranges_.data());
  }

  const Field<T>& field_;
  const BrickLookup& bricks_;
  std::vector<Int3> tiles_;  ///< that are searched, in Morton order
  std::vector<T> tile_blocks_, columns_, ranges_;
  std::vector<std::uint32_t> block_of_tile_;
  std::vector<std::int32_t> coordinates_;
  gpu::CaseTable cases_;
};

/// What extractions of a volume count and report with; ResidentLauncher keeps the same.
struct KernelState {
  KernelState(std::uint32_t tiles, std::size_t grid_tiles)
      : items(tiles),
        slots(grid_tiles, gpu::kNone),
        order(tiles),
        row_tables(tiles),
        sample_tables(tiles),
        work(kBlocks),
        trilinear_work(kBlocks),
        zeroed(3 + (tiles + gpu::kTilesOfSearchBlock - 1) / gpu::kTilesOfSearchBlock) {}

  std::vector<gpu::TileItem> items;
  std::vector<std::uint32_t> slots;
  std::vector<gpu::OrderState> order;
  std::vector<gpu::RowTable> row_tables;
  std::vector<gpu::SampleTable> sample_tables;
  static constexpr unsigned kBlocks = 3;  ///< at most, of an extraction
  std::vector<gpu::SampleWork> work;
  std::vector<gpu::TrilinearWork> trilinear_work;
  std::uint32_t launches = 0, epoch = 0;
  unsigned long long number_start = 0, number_end = 0;
  std::uint32_t found = 0, item_count = 0;
  /// Tickets of search and extraction, blocks that are done, a word of padding; degenerate
  /// triangles; the search's sums.
  std::vector<unsigned long long> zeroed;
  gpu::LaunchReport report{};

  std::uint32_t* zeroed_words() { return reinterpret_cast<std::uint32_t*>(zeroed.data()); }

  /// For the next search.
  void give(gpu::SearchParams& p) {
    p.items = items.data();
    p.found = &found;
    p.item_count = &item_count;
    p.item_room = static_cast<std::uint32_t>(items.size());
    p.slot_of_tile = slots.data();
    p.order = order.data();
    p.sums = zeroed.data() + 3;
    p.ticket = zeroed_words();
  }
  /// For the extraction of what that has found.
  void give(gpu::TileParams& p) {
    p.items = items.data();
    p.item_count = &item_count;
    p.slot_of_tile = slots.data();
    p.epoch = ++epoch;
    p.row_tables = row_tables.data();
    p.order = order.data();
    p.number_start = &number_start;
    p.number_end = &number_end;
    p.ticket = zeroed_words() + 1;
    p.on_samples.work = work.data();
    p.on_samples.tables = sample_tables.data();
    p.on_samples.left_out = &zeroed[2];
    p.trilinear = {trilinear_work.data(), &topology_tables()};
    p.end = {&report,
             ++launches,
             &found,
             nullptr,
             zeroed_words() + 2,
             zeroed_words(),
             static_cast<std::uint32_t>(2 * zeroed.size())};
  }

  std::uint64_t word(int i) {
    return std::atomic_ref(report.words[i]).load(std::memory_order_relaxed);
  }
  void expect_reported(const isobrick::Mesh& mesh, std::uint64_t left_out = 0) {
    using gpu::LaunchReport, gpu::LaunchWord;
    const std::uint64_t vertices = mesh.positions.size(), triangles = mesh.triangles.size();
    EXPECT_EQ(word(LaunchReport::kVertices), LaunchWord::of(vertices, launches));
    EXPECT_EQ(word(LaunchReport::kTriangles), LaunchWord::of(triangles, launches));
    EXPECT_EQ(word(LaunchReport::kActiveTiles), LaunchWord::of(found, launches));
    EXPECT_EQ(word(LaunchReport::kLeftOut), LaunchWord::of(left_out, launches));
  }
  /// As the next isovalue needs it.
  void expect_zeroed() const {
    EXPECT_TRUE(std::ranges::all_of(zeroed, [](auto word) { return word == 0; }));
  }
};

}  // namespace isobrick::testing

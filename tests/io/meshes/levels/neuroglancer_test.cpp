#include "io/meshes/levels/neuroglancer_folder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include "io/meshes/levels/level_fragments.h"
#include "tests/io/meshes/levels/decoded_levels.h"
#include "tests/io/meshes/levels/decoded_tiles.h"
#include "tests/io/meshes/levels/lattice_fixture.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

using Cells = std::set<GridCell>;

/// Where neuroglancer's decoder parts fragments.
constexpr std::int64_t kMiddle = 32768;

/// Fails unless a level's fragments are in the order of the Z-curve, each once, and their triangles
/// cross no middle.
void check_level(const DecodedLevel& level, bool has_halves) {
  std::uint64_t before = 0;
  for (const DecodedFragment& fragment : level.fragments) {
    const std::uint64_t key = z_order_key(fragment.cell);
    EXPECT_TRUE(&fragment == level.fragments.data() || key > before);
    before = key;
    if (!has_halves) continue;
    for (const Triangle& t : fragment.triangles)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t middle = std::int64_t{fragment.cell[axis]} * ChunkGrid::kSteps + kMiddle;
        int sides = 0;
        for (const std::uint32_t v : t) {
          const std::int64_t x = fragment.points[v][axis];
          sides |= x < middle ? 1 : x > middle ? 2 : 0;
        }
        EXPECT_NE(sides, 3) << "a triangle crosses the middle";
      }
  }
}

/// Fails unless every fragment has a parent, and every half with triangles a child.
void check_octree(const DecodedMesh& mesh) {
  for (std::size_t level = 1; level < mesh.levels.size(); ++level) {
    Cells parents, children;
    for (const DecodedFragment& fragment : mesh.levels[level].fragments)
      parents.insert(fragment.cell);
    for (const DecodedFragment& fragment : mesh.levels[level - 1].fragments) {
      const GridCell& c = fragment.cell;
      children.insert(c);
      EXPECT_TRUE(parents.contains({c[0] / 2, c[1] / 2, c[2] / 2}));
    }
    for (const DecodedFragment& fragment : mesh.levels[level].fragments)
      for (const Triangle& t : fragment.triangles) {
        GridCell half{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          std::int64_t lo = fragment.points[t[0]][axis];
          for (const std::uint32_t v : t) lo = std::min(lo, fragment.points[v][axis]);
          const std::int64_t middle =
              std::int64_t{fragment.cell[axis]} * ChunkGrid::kSteps + kMiddle;
          half[axis] = 2 * fragment.cell[axis] + (lo >= middle ? 1 : 0);
        }
        EXPECT_TRUE(children.contains(half)) << "level " << level;
      }
  }
}

class Neuroglancer : public testing::Test {
 protected:
  fs::path path(const std::string& name = "mesh.neuroglancer") const { return folder_ / name; }

  DecodedMesh save(const Mesh& mesh, const MeshFileOptions& options = {}) const {
    mesh.save(path(), options);
    return decode_segment(path());
  }

  TemporaryFolder folder_;
};

TEST_F(Neuroglancer, EveryLevelIsTheClosedMesh) {
  const Mesh mesh = make_torus(400, {3, -2, 100});
  const DecodedMesh decoded = save(mesh);
  ASSERT_EQ(decoded.levels.size(), 3U);
  ASSERT_GT(decoded.levels[0].fragments.size(), 8U);
  EXPECT_EQ(decoded.levels[2].fragments.size(), 1U) << "one part has the whole mesh";
  const double pi = std::numbers::pi, volume = 2 * pi * pi * 0.16 * 64;
  double scale = 0;
  std::uint64_t triangles = 2 * mesh.triangles.size();
  for (std::size_t level = 0; level < decoded.levels.size(); ++level) {
    const DecodedLevel& of_level = decoded.levels[level];
    check_level(of_level, level > 0);
    const std::vector<LatticeTriangle> all = of_level.lattice_triangles();
    EXPECT_EQ(open_sides(all), 0U) << "level " << level;
    EXPECT_NEAR(volume_of(all) / 6 * std::pow(decoded.step(level), 3), volume, 0.01 * volume);
    EXPECT_GT(of_level.scale, scale);
    scale = of_level.scale;
    // Pieces at faces and middles are more than a quarter.
    EXPECT_LT(of_level.triangles(), level == 0 ? triangles : triangles * 2 / 5);
    triangles = of_level.triangles();
  }
  check_octree(decoded);
}

TEST_F(Neuroglancer, TheOctreeIsCompleteWhereACoarseLevelMissesCells) {
  const DecodedMesh decoded = save(sheet_below_a_plane(), {.levels = 4});
  check_octree(decoded);
  std::size_t empty = 0;
  for (const DecodedLevel& level : decoded.levels)
    for (const DecodedFragment& fragment : level.fragments) empty += fragment.triangles.empty();
  EXPECT_GT(empty, 0U) << "this mesh needs no empty fragment";
}

TEST_F(Neuroglancer, TheFinestLevelHasEveryVertex) {
  const Mesh mesh = make_torus(300);
  const DecodedMesh decoded = save(mesh, {.levels = 1});
  ASSERT_EQ(decoded.levels.size(), 1U);
  ChunkGrid grid;
  grid.origin = decoded.origin;
  grid.edge = decoded.edges[0];
  grid.cells = {1000, 1000, 1000};
  std::set<LatticePoint> points;
  for (const DecodedFragment& fragment : decoded.levels[0].fragments)
    points.insert(fragment.points.begin(), fragment.points.end());
  for (const Vec3f& p : mesh.positions) {
    const LatticePoint nearest = grid.quantize(p, 0);
    EXPECT_TRUE(points.contains(nearest));
    const Vec3d at = decoded.position(0, nearest);
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(at[axis], p[axis], decoded.step(0));
  }
  // 64 edges of triangles a fragment, of which each has 65535 steps.
  EXPECT_LT(decoded.step(0), decoded.levels[0].scale / 1000);
}

TEST_F(Neuroglancer, TheFinestLevelHasTheTrianglesOf3dTiles) {
  const Mesh mesh = make_torus(300, {-20, 5, 1});
  const DecodedMesh decoded = save(mesh);
  mesh.save(path("mesh.3dtiles"));
  const double step = decoded.step(0);
  std::multiset<LatticeTriangle> expected, found;
  const auto from_first_corner = [](LatticeTriangle t) {
    std::ranges::rotate(t, std::ranges::min_element(t));
    return t;
  };
  for (const LatticeTriangle& t : decoded.levels[0].lattice_triangles())
    expected.insert(from_first_corner(t));
  const DecodedTileset tiles = decode_tiles(path("mesh.3dtiles"));
  for (const DecodedTile* tile : tiles.of_level(0))
    for (const Triangle& t : tile->triangles) {
      LatticeTriangle points;
      for (std::size_t corner = 0; corner < 3; ++corner)
        for (int axis = 0; axis < 3; ++axis)
          points[corner][static_cast<std::size_t>(axis)] =
              std::llround(double{tile->stored[t[corner]][axis]} / step);
      found.insert(from_first_corner(points));
    }
  EXPECT_GT(found.size(), mesh.triangles.size());
  EXPECT_TRUE(found == expected);
}

TEST_F(Neuroglancer, ThreadsMemoryAndChunksNeverShow) {
  const Mesh mesh = make_torus(500);
  mesh.save(path());
  const std::string index = read_text(path() / "1.index"), data = read_text(path() / "1");
  for (const int threads : {1, 3})
    for (const std::uint64_t mib : {64, 4096}) {
      fs::remove_all(path());
      const auto sink = create_mesh_file(path(), {.threads = threads, .memory = mib << 20});
      sink->begin({});
      const std::span<const Vec3f> positions = mesh.positions.span();
      for (std::size_t i = 0; i < positions.size(); i += 999) {
        const std::size_t count = std::min<std::size_t>(999, positions.size() - i);
        sink->write({.first_vertex = i, .positions = positions.subspan(i, count)});
      }
      sink->write({.first_vertex = positions.size(), .triangles = mesh.triangles.span()});
      sink->finish();
      EXPECT_EQ(read_text(path() / "1.index"), index);
      EXPECT_EQ(read_text(path() / "1"), data);
    }
}

TEST_F(Neuroglancer, LevelsEndWhereNothingCanBeSimplified) {
  const Mesh mesh = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                            {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  const DecodedMesh decoded = save(mesh, {.levels = 9});
  ASSERT_EQ(decoded.levels.size(), 1U);
  EXPECT_EQ(open_sides(decoded.levels[0].lattice_triangles()), 0U);
  EXPECT_EQ(decoded.levels[0].triangles(), 4U);
}

TEST_F(Neuroglancer, AnEmptyMeshHasAnEmptyFragment) {
  const DecodedMesh decoded = save(Mesh());
  ASSERT_EQ(decoded.levels.size(), 1U) << "neuroglancer takes no segment without levels";
  ASSERT_EQ(decoded.levels[0].fragments.size(), 1U);
  EXPECT_EQ(decoded.levels[0].triangles(), 0U);
  EXPECT_GT(decoded.levels[0].scale, 0) << "0 would be a level that is not there";
}

TEST_F(Neuroglancer, TakesMeshesThatShrinkToNothing) {
  const Mesh mesh = mesh_of(std::vector<Vec3f>(3, {1e6F, 1e6F, 1e6F}), {{0, 1, 2}});
  const DecodedMesh decoded = save(mesh);
  ASSERT_EQ(decoded.levels.size(), 1U);
  EXPECT_EQ(decoded.levels[0].triangles(), 0U);
}

TEST_F(Neuroglancer, KeepsSheetsThatShareASide) {
  // Four triangles at one side, which no manifold has: all of them are stored.
  const Mesh mesh = mesh_of({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}},
                            {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {0, 1, 5}});
  EXPECT_EQ(save(mesh, {.levels = 1}).levels[0].triangles(), 4U);
}

TEST_F(Neuroglancer, TheDescriptionHasTheUnitAndTheName) {
  Mesh mesh = make_torus(40);
  mesh.unit = "millimeter";
  mesh.save(path("head.neuroglancer"));
  const std::string info = read_text(path("head.neuroglancer") / "info");
  EXPECT_NE(info.find("\"@type\":\"neuroglancer_multilod_draco\""), info.npos) << info;
  EXPECT_NE(info.find("\"transform\":[1000000.0,0,0,0,0,1000000.0,0,0,0,0,1000000.0,0]"), info.npos)
      << info;
  EXPECT_EQ(info.find("sharding"), info.npos);
  const std::string properties =
      read_text(path("head.neuroglancer") / "segment_properties" / "info");
  EXPECT_NE(properties.find("\"ids\":[\"1\"]"), properties.npos) << properties;
  EXPECT_NE(properties.find("\"values\":[\"head\"]"), properties.npos) << properties;
}

TEST_F(Neuroglancer, ReplacesNothingButItsOwnKind) {
  const Mesh mesh = make_torus(40);
  mesh.save(path());
  EXPECT_THROW(mesh.save(path()), UsageError);
  mesh.save(path(), {.force = true});
  mesh.save(path(), {.sharded = true, .force = true});
  EXPECT_FALSE(fs::exists(path() / "1"));
  EXPECT_NE(
      read_text(path() / "info").find("\"sharding\":{\"@type\":\"neuroglancer_uint64_sharded_v1\""),
      std::string::npos);
  std::ofstream(path() / "segment_properties" / "notes.txt") << "mine";
  EXPECT_THROW(mesh.save(path(), {.force = true}), UsageError);
  EXPECT_EQ(read_text(path() / "segment_properties" / "notes.txt"), "mine");
}

TEST_F(Neuroglancer, WhatIsNotFinishedLeavesNothing) {
  {
    const auto sink = create_mesh_file(path(), {});
    sink->begin({});
  }
  EXPECT_TRUE(fs::is_empty(path().parent_path()));
}

TEST_F(Neuroglancer, RefusesLevelsThatMakeNoSense) {
  const Mesh mesh = make_torus(40);
  EXPECT_THROW(mesh.save(path(), {.levels = -1}), UsageError);
  EXPECT_THROW(mesh.save(path(), {.levels = kMaxMeshLevels + 1}), UsageError);
  EXPECT_THROW(mesh.save(path("m.ply"), {.levels = 2}), UsageError);
  EXPECT_THROW(mesh.save(path("m.ply"), {.sharded = true}), UsageError);
  EXPECT_TRUE(fs::is_empty(path().parent_path()));
}

TEST(NeuroglancerNames, AreThoseOfItsFiles) {
  for (const char* name : {"info", "1", "18446744073709551615", "7.index", "0.shard", "1f.shard",
                           "segment_properties/info"})
    EXPECT_TRUE(NeuroglancerFolder::is_own_name(name)) << name;
  for (const char* name : {"", "1.ply", ".index", ".shard", "x.shard", "-1", "labels.json",
                           "segment_properties/1", "other/info", "1F.shard"})
    EXPECT_FALSE(NeuroglancerFolder::is_own_name(name)) << name;
}

}  // namespace
}  // namespace isobrick::test

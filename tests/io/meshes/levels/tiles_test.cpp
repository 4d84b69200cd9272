#include "io/meshes/levels/tiles_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include "core/vectors.h"
#include "filters/removed_points.h"
#include "tests/io/meshes/levels/decoded_tiles.h"
#include "tests/io/meshes/levels/lattice_fixture.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// A corner of a level, by the floats that its files have: neighbours must have the same.
using StoredPoint = std::array<float, 3>;

/// All triangles of a level as one mesh whose equal positions are one vertex, in metres.
Mesh joined_level(const DecodedTileset& tileset, int level) {
  std::map<StoredPoint, std::uint32_t> numbers;
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (const DecodedTile* tile : tileset.of_level(level))
    for (const Triangle& t : tile->triangles) {
      Triangle joined;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vec3f& p = tile->stored[t[i]];
        const auto [at, is_new] = numbers.emplace(StoredPoint{p.x, p.y, p.z}, positions.size());
        if (is_new) positions.push_back(to_float(tile->positions[t[i]]));
        joined[i] = at->second;
      }
      triangles.push_back(joined);
    }
  return mesh_of(positions, triangles);
}

Mesh with_normals(Mesh mesh) {
  mesh.normals.resize(mesh.positions.size());
  std::vector<Vec3d> sums(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = to_double(mesh.positions[t[0]]);
    const Vec3d n = cross(to_double(mesh.positions[t[1]]) - a, to_double(mesh.positions[t[2]]) - a);
    for (const std::uint32_t v : t) sums[v] = sums[v] + n;
  }
  for (std::size_t v = 0; v < sums.size(); ++v)
    mesh.normals[v] = to_float(unit(sums[v], {0, 0, 1}));
  return mesh;
}

/// How far the vertices of a mesh, and points on its sides and triangles, are at most from another.
double distance_between(const Mesh& from, const Mesh& to) {
  double largest = 0;
  const auto test = [&](Vec3d p) {
    double least = std::numeric_limits<double>::infinity();
    for (const Triangle& t : to.triangles) {
      least = std::min(
          least, squared_distance(p, to_double(to.positions[t[0]]), to_double(to.positions[t[1]]),
                                  to_double(to.positions[t[2]])));
      if (least <= largest) return;
    }
    largest = std::max(largest, least);
  };
  for (const Triangle& t : from.triangles) {
    const Vec3d a = to_double(from.positions[t[0]]), b = to_double(from.positions[t[1]]),
                c = to_double(from.positions[t[2]]);
    test(a);
    test((a + b) * 0.5);
    test((a + b + c) * (1.0 / 3));
  }
  return std::sqrt(largest);
}

class Tiles : public testing::Test {
 protected:
  fs::path path(const std::string& name = "mesh.3dtiles") const { return folder_ / name; }

  DecodedTileset save(const Mesh& mesh, const MeshFileOptions& options = {}) const {
    mesh.save(path(), options);
    return decode_tiles(path());
  }

  TemporaryFolder folder_;
};

TEST_F(Tiles, EveryLevelIsTheClosedMesh) {
  const Mesh mesh = make_torus(400, {3, -2, 100});
  const DecodedTileset tileset = save(mesh);
  ASSERT_EQ(tileset.levels(), 3);
  ASSERT_GT(tileset.of_level(0).size(), 8U);
  EXPECT_EQ(tileset.of_level(2).size(), 1U) << "one part has the whole mesh";
  EXPECT_EQ(tileset.tiles.front().level, 2);
  const double pi = std::numbers::pi, volume = 2 * pi * pi * 0.16 * 64;
  std::size_t before = 0;
  for (int level = 2; level >= 0; --level) {
    const Mesh joined = joined_level(tileset, level);
    const MeshMeasure measured = measure(joined);
    EXPECT_EQ(measured.open_sides, 0U) << "level " << level;
    EXPECT_EQ(measured.euler_number, 0);
    EXPECT_NEAR(*measured.volume, volume, 0.01 * volume);
    for (int axis = 0; axis < 3; ++axis) {
      // y up in the files, z up in the world; coarse vertices are some of the fine ones.
      EXPECT_NEAR(measured.bounds->lo[axis], measure(mesh).bounds->lo[axis], 0.05);
      EXPECT_NEAR(measured.bounds->hi[axis], measure(mesh).bounds->hi[axis], 0.05);
    }
    EXPECT_GT(joined.triangles.size(), 3 * before);
    before = joined.triangles.size();
  }
}

TEST_F(Tiles, TheFinestLevelHasTheTrianglesOfTheMesh) {
  const Mesh mesh = make_torus(120);
  const DecodedTileset tileset = save(mesh, {.levels = 1});
  ASSERT_EQ(tileset.levels(), 1);
  const Mesh joined = joined_level(tileset, 0);
  const MeshMeasure whole = measure(mesh), stored = measure(joined);
  EXPECT_NEAR(stored.area, whole.area, 1e-4 * whole.area);
  // Every vertex of the mesh is there, but for a step or so of the lattice.
  const double side = 2 * 4 * std::numbers::pi / 120 / 2;
  std::vector<Vec3f> points(joined.positions.begin(), joined.positions.end());
  std::ranges::sort(points, {}, &Vec3f::x);
  for (const Vec3f& p : mesh.positions) {
    double least = 1;
    const auto from = std::ranges::lower_bound(points, p.x - 0.01F, {}, &Vec3f::x);
    for (auto at = from; at != points.end() && at->x < p.x + 0.01F; ++at)
      least = std::min(least, length(to_double(*at - p)));
    EXPECT_LT(least, side / 500);
  }
}

TEST_F(Tiles, ErrorsAreTrue) {
  const Mesh mesh = make_torus(100, {-7, 1, 2});
  const DecodedTileset tileset = save(mesh, {.levels = 3});
  ASSERT_EQ(tileset.levels(), 3);
  const Mesh finest = joined_level(tileset, 0);
  for (const DecodedTile* tile : tileset.of_level(0)) EXPECT_EQ(tile->error, 0);
  for (const int level : {1, 2}) {
    const double distance = distance_between(finest, joined_level(tileset, level));
    ASSERT_GT(distance, 0);
    for (const DecodedTile* tile : tileset.of_level(level)) {
      EXPECT_GE(tile->error, distance);
      EXPECT_LT(tile->error, 6 * distance) << "a bound, but no wild one";
    }
  }
  EXPECT_GT(tileset.error, 10) << "of showing nothing";
}

TEST_F(Tiles, ACellThatOneLevelMissesHasATileWithoutContent) {
  const DecodedTileset tileset = save(sheet_below_a_plane(), {.levels = 4});
  std::size_t missed = 0, ends = 0;
  for (const DecodedTile& tile : tileset.tiles) {
    if (tile.level >= 0 || tile.depth == 0) continue;
    const DecodedTile& parent = tileset.tiles[tile.parent];
    const bool is_leaf = std::ranges::none_of(tileset.tiles, [&](const DecodedTile& other) {
      return &other != &tile && &tileset.tiles[other.parent] == &tile;
    });
    // Refined as early as its parent, or nothing takes the place of a coarse surface.
    if (is_leaf) {
      EXPECT_EQ(tile.error, 0);
      EXPECT_GE(parent.level, 1);
      ++ends;
    } else if (parent.level >= 0) {
      EXPECT_EQ(tile.error, parent.error);
      ++missed;
    }
  }
  EXPECT_GT(missed + ends, 0U) << "this mesh has no such cell";
}

TEST_F(Tiles, ErrorsCountTheRoundingOfPositions) {
  // A flat sheet, in no plane of the lattice: nothing else moves.
  constexpr std::uint32_t n = 80;
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t k = 0; k <= n; ++k) {
      const auto x = static_cast<float>(i), y = static_cast<float>(k);
      positions.push_back({x, y, 0.37123F * x + 0.26789F * y});
      if (i == n || k == n) continue;
      const std::uint32_t a = i * (n + 1) + k, b = a + n + 1;
      triangles.push_back({a, b, b + 1});
      triangles.push_back({a, b + 1, a + 1});
    }
  const DecodedTileset tileset = save(mesh_of(positions, triangles), {.levels = 2});
  ASSERT_EQ(tileset.levels(), 2);
  const double distance = distance_between(joined_level(tileset, 1), joined_level(tileset, 0));
  const double step = 64 * 1.5 / 65535;
  EXPECT_GT(distance, step / 10);
  for (const DecodedTile* tile : tileset.of_level(1)) {
    EXPECT_GE(tile->error, distance);
    EXPECT_LT(tile->error, 20 * step);
  }
}

TEST_F(Tiles, FewLevelsHaveTilesWithoutContentAbove) {
  const DecodedTileset tileset = save(make_torus(400), {.levels = 1});
  EXPECT_EQ(tileset.tiles.front().level, -1);
  EXPECT_GT(tileset.tiles.front().error, 5) << "of showing nothing";
  EXPECT_EQ(tileset.levels(), 1);
}

/// Triangles all over a square, each far from the others.
Mesh scattered_triangles(std::uint32_t n) {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t k = 0; k < n; ++k) {
      const auto x = static_cast<float>(200 * i), y = static_cast<float>(200 * k);
      const auto first = static_cast<std::uint32_t>(positions.size());
      for (const Vec3f corner : {Vec3f{x, y, 0}, Vec3f{x + 1, y, 0}, Vec3f{x, y + 1, 1}})
        positions.push_back(corner);
      triangles.push_back({first, first + 1, first + 2});
    }
  return mesh_of(positions, triangles);
}

TEST_F(Tiles, ALargeTreeHasSeveralFiles) {
  const DecodedTileset tileset = save(scattered_triangles(60), {.levels = 1});
  EXPECT_EQ(tileset.of_level(0).size(), 3600U);
  EXPECT_GT(tileset.tiles.size(), 4096U);
  EXPECT_GT(tileset.tilesets.size(), 8U);
  for (const std::string& name : tileset.tilesets) {
    EXPECT_LT(fs::file_size(path() / name), 300'000U) << name;
    EXPECT_TRUE(TilesFolder::is_own_name(name)) << name;
  }
  for (const std::string& name : tileset.files) EXPECT_TRUE(TilesFolder::is_own_name(name)) << name;
}

TEST_F(Tiles, NormalsAreThoseOfTheMesh) {
  const Vec3f centre{5, 6, 7};
  const DecodedTileset tileset = save(with_normals(make_torus(300, centre)));
  for (const DecodedTile& tile : tileset.tiles) {
    if (tile.level < 0) continue;
    ASSERT_EQ(tile.normals.size(), tile.positions.size());
    for (std::size_t i = 0; i < tile.normals.size(); ++i) {
      const Vec3d n = to_double(tile.normals[i]), p = tile.positions[i] - to_double(centre);
      EXPECT_NEAR(length(n), 1, 1e-5);
      const double around = std::hypot(p.x, p.y);
      const Vec3d outward = unit({p.x - 4 * p.x / around, p.y - 4 * p.y / around, p.z}, {0, 0, 1});
      EXPECT_GT(dot(n, outward), 0.97);
    }
  }
  fs::remove_all(path());
  for (const DecodedTile& tile : save(make_torus(60)).tiles) EXPECT_TRUE(tile.normals.empty());
}

TEST_F(Tiles, NormalsAreMadeWhereTheMeshHasNone) {
  const Mesh torus = make_torus(120);
  const auto made = [&](const Mesh& mesh, bool makes_normals) {
    const auto sink = create_level_mesh(path(), true, {.as_tiles = true},
                                        {.levels = 2, .makes_normals = makes_normals});
    sink->begin({.has_normals = !mesh.normals.empty()});
    sink->write(mesh.chunk());
    sink->finish();
    return decode_tiles(path());
  };
  const DecodedTileset expected = made(with_normals(make_torus(120)), false),
                       found = made(torus, true);
  ASSERT_EQ(found.tiles.size(), expected.tiles.size());
  for (std::size_t i = 0; i < found.tiles.size(); ++i) {
    ASSERT_EQ(found.tiles[i].normals.size(), expected.tiles[i].normals.size());
    for (std::size_t k = 0; k < found.tiles[i].normals.size(); ++k)
      EXPECT_GT(dot(found.tiles[i].normals[k], expected.tiles[i].normals[k]), 0.9999F);
  }
  for (const DecodedTile& tile : made(torus, false).tiles) EXPECT_TRUE(tile.normals.empty());
}

TEST_F(Tiles, TheWorldIsInMetres) {
  Mesh mesh = make_torus(200, {1000, 0, 0});
  mesh.unit = "millimeter";
  const DecodedTileset tileset = save(mesh);
  const MeshBounds box = tileset.tiles.front().box;
  EXPECT_NEAR(box.lo.x, 1 - 0.0056, 1e-5);
  EXPECT_NEAR(box.hi.x, 1 + 0.0056, 1e-5);
  EXPECT_NEAR(box.hi.z, 0.0016, 1e-5);
  for (const DecodedTile& tile : tileset.tiles) EXPECT_LT(tile.error, 0.02);
  EXPECT_EQ(tileset.tiles.front().gltf["asset"]["extras"]["unit"], "millimeter");
}

TEST_F(Tiles, ThreadsMemoryAndChunksNeverShow) {
  const Mesh mesh = with_normals(make_torus(500));
  mesh.save(path());
  const auto content = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(path()))
      if (entry.is_regular_file()) {
        std::ifstream in(entry.path(), std::ios::binary);
        files[fs::relative(entry.path(), path()).string()] =
            std::string(std::istreambuf_iterator<char>(in), {});
      }
    return files;
  };
  const auto first = content();
  for (const int threads : {1, 3})
    for (const std::uint64_t mib : {64, 4096}) {
      fs::remove_all(path());
      const auto sink = create_mesh_file(path(), {.threads = threads, .memory = mib << 20});
      sink->begin({.has_normals = true});
      const std::span<const Vec3f> positions = mesh.positions.span(), normals = mesh.normals.span();
      for (std::size_t i = 0; i < positions.size(); i += 999) {
        const std::size_t count = std::min<std::size_t>(999, positions.size() - i);
        sink->write({.first_vertex = i,
                     .positions = positions.subspan(i, count),
                     .normals = normals.subspan(i, count)});
      }
      sink->write({.first_vertex = positions.size(), .triangles = mesh.triangles.span()});
      sink->finish();
      EXPECT_TRUE(content() == first);
      std::uint64_t bytes = 0;
      for (const auto& [name, text] : first) bytes += text.size();
      EXPECT_EQ(sink->bytes(), bytes);
    }
}

TEST_F(Tiles, SmallMeshes) {
  const DecodedTileset empty = save(Mesh());
  ASSERT_EQ(empty.tiles.size(), 1U);
  EXPECT_EQ(empty.levels(), 0);
  fs::remove_all(path());
  // Its triangle has three corners at one place.
  const Mesh point = mesh_of(std::vector<Vec3f>(3, {1e6F, 1e6F, 1e6F}), {{0, 1, 2}});
  EXPECT_EQ(save(point).levels(), 0);
  fs::remove_all(path());
  const Mesh tetrahedron = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                   {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  const DecodedTileset one = save(tetrahedron, {.levels = 9});
  EXPECT_EQ(one.levels(), 1) << "nothing can be simplified";
  EXPECT_EQ(measure(joined_level(one, 0)).open_sides, 0U);
  fs::remove_all(path());
  const Mesh flat = mesh_of({{0, 0, 5}, {1, 0, 5}, {0, 1, 5}}, {{0, 1, 2}});
  EXPECT_EQ(save(flat).of_level(0).size(), 1U);
}

TEST_F(Tiles, ReplaceNothingButTheirOwnKind) {
  const Mesh mesh = make_torus(40);
  mesh.save(path());
  EXPECT_THROW(mesh.save(path()), UsageError);
  mesh.save(path(), {.force = true});
  EXPECT_GT(decode_tiles(path()).tiles.size(), 0U);
  std::ofstream(path() / "0" / "notes.txt") << "mine";
  EXPECT_THROW(mesh.save(path(), {.force = true}), UsageError);
  EXPECT_TRUE(fs::exists(path() / "0" / "notes.txt"));
}

TEST_F(Tiles, WhatIsNotFinishedLeavesNothing) {
  {
    const auto sink = create_mesh_file(path(), {});
    sink->begin({});
  }
  EXPECT_TRUE(fs::is_empty(path().parent_path()));
}

TEST_F(Tiles, RefuseOptionsThatMakeNoSense) {
  const Mesh mesh = make_torus(40);
  EXPECT_THROW(mesh.save(path(), {.levels = -1}), UsageError);
  EXPECT_THROW(mesh.save(path(), {.levels = kMaxMeshLevels + 1}), UsageError);
  EXPECT_THROW(mesh.save(path(), {.sharded = true}), UsageError);
  EXPECT_TRUE(fs::is_empty(path().parent_path()));
}

}  // namespace
}  // namespace isobrick::test

#include <gtest/gtest.h>
#include <openvdb/math/Proximity.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <cmath>
#include <cstring>

#include <isobrick/error.h>
#include <isobrick/export.h>
#include <isobrick/extract.h>
#include <isobrick/open_source.h>
#include "io/volumes/vdb/vdb_level_set.h"
#include "pipeline/program_memory.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::inline v0 {
namespace {

using namespace test;

/// Keeps the triangles of a mesh.
class TriangleList final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t v : t)
        corners.emplace_back(chunk.positions[v].x, chunk.positions[v].y, chunk.positions[v].z);
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  std::vector<openvdb::Vec3d> corners;  ///< three a triangle
};

class ExportVdb : public ::testing::Test {
 protected:
  ExportVdb() { openvdb::initialize(); }

  void convert_to(MemorySource& source, const char* name, Index brick) {
    ConvertOptions options;
    options.brick = brick;
    options.shard = 2 * brick;
    convert_quietly(source, folder_ / name, options);
  }

  openvdb::FloatGrid::Ptr level_set(const char* store, double isovalue, int half_band = 3,
                                    std::optional<Box3> roi = {}) {
    NoProgress none;
    export_volume(StoreReader(folder_ / store), folder_ / "x.vdb",
                  {.format = ExportFormat::vdb,
                   .isovalue = isovalue,
                   .half_band = half_band,
                   .roi = roi,
                   .force = true,
                   .memory = 200 * kMiB,
                   .threads = 2},
                  none);
    openvdb::io::File file((folder_ / "x.vdb").string());
    file.open();
    return openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("surface"));
  }

  /// Squares of distances from the sphere's centre would have a coarser surface.
  MemorySource sphere() const {
    std::vector<float> samples;
    for_each_point({{0, 0, 0}, kExtent}, [&](Int3 p) {
      samples.push_back(static_cast<float>(kRadius - from_centre(p)));
    });
    MemorySource source(kExtent, ScalarType::f32, as_bytes(samples));
    Transform& transform = source.mutable_info().transform;
    transform.spacing = {0.5, 0.5, 0.5};
    transform.origin = {100, -20, 7};
    transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    transform.unit = "millimeter";
    return source;
  }
  static double from_centre(Int3 p) {
    return std::hypot(static_cast<double>(p.x) - kCentre.x, static_cast<double>(p.y) - kCentre.y,
                      static_cast<double>(p.z) - kCentre.z);
  }

  static constexpr Int3 kExtent{50, 47, 45};
  static constexpr Vec3d kCentre{24.3, 22.9, 21.7};
  static constexpr double kRadius = 17.4;

  TemporaryFolder folder_;
};

TEST_F(ExportVdb, DistancesFromASphere) {
  MemorySource source = sphere();
  convert_to(source, "a", 16);
  const auto grid = level_set("a", 0);
  EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_EQ(grid->background(), 1.5F);
  const auto accessor = grid->getConstAccessor();
  for_each_point({{0, 0, 0}, kExtent}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    const double distance = 0.5 * (from_centre(p) - kRadius);
    const auto value = static_cast<double>(accessor.getValue(at));
    const bool active = accessor.isValueOn(at);
    ASSERT_EQ(value < 0, distance <= 0) << p.x << ' ' << p.y << ' ' << p.z;
    // The mesh is flat between samples: a hundredth of a voxel inside the sphere.
    if (std::abs(distance) < 1.48) {
      ASSERT_TRUE(active);
    }
    if (std::abs(distance) > 1.52) {
      ASSERT_FALSE(active);
    }
    const double expected = std::clamp(distance, -1.5, 1.5);
    ASSERT_NEAR(value, expected, 0.02) << p.x << ' ' << p.y << ' ' << p.z;
  });
  // Far inside it is tiles.
  EXPECT_EQ(grid->tree().probeConstLeaf({24, 24, 24}), nullptr);
  EXPECT_EQ(accessor.getValue({-5, 3, 3}), 1.5F);
  // Its own surface is ours.
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*grid, points, quads, 0.0);
  ASSERT_GT(points.size(), 3000U);
  const Vec3d c = source.info().transform.apply(kCentre);
  for (const openvdb::Vec3s& p : points)
    ASSERT_NEAR((openvdb::Vec3d(p) - openvdb::Vec3d(c.x, c.y, c.z)).length(), 0.5 * kRadius, 0.25);
}

/// What a mesh encloses: positive where triangles are counter-clockwise seen from outside.
double enclosed(const StoreReader& store, double isovalue, std::optional<Inside> inside = {}) {
  TriangleList mesh;
  NoProgress none;
  extract(store, {.isovalue = isovalue, .inside = inside, .backend = Backend::cpu}, mesh, none);
  double six = 0;
  for (std::size_t i = 0; i + 2 < mesh.corners.size(); i += 3) {
    const openvdb::Vec3d &a = mesh.corners[i], &b = mesh.corners[i + 1], &c = mesh.corners[i + 2];
    const openvdb::Vec3d o = mesh.corners[0];
    six += (a - o).dot((b - o).cross(c - o));
  }
  return six / 6;
}

TEST_F(ExportVdb, ASpheresLevelSetEnclosesItsVolumeWhateverWayItGoes) {
  MemorySource source = sphere();
  convert_to(source, "a", 16);  // larger inside
  const double volume = 4.0 / 3 * std::acos(-1.0) * std::pow(0.5 * kRadius, 3);
  const auto expect_volume = [&](const char* store) {
    EXPECT_NEAR(enclosed(StoreReader(folder_ / store), 0), volume, 0.01 * volume) << store;
  };
  const auto convert_file = [&](const char* file, const char* store) {
    const auto made = open_source(folder_ / file, {});
    ConvertOptions options;
    options.brick = 16;
    convert_quietly(*made, folder_ / store, options);
  };
  expect_volume("a");
  level_set("a", 0);
  convert_file("x.vdb", "b");  // a level set: smaller inside
  EXPECT_EQ(StoreReader(folder_ / "b").info().grid_class, "level set");
  expect_volume("b");
  EXPECT_NEAR(enclosed(StoreReader(folder_ / "b"), 0, Inside::above), -volume, 0.01 * volume);
  EXPECT_NEAR(enclosed(StoreReader(folder_ / "a"), 0, Inside::below), -volume, 0.01 * volume);
  // Its samples, and its own surface once more.
  NoProgress none;
  export_volume(StoreReader(folder_ / "b"), folder_ / "y.vdb", {.format = ExportFormat::vdb}, none);
  convert_file("y.vdb", "c");
  expect_volume("c");
  const auto grid = level_set("b", 0);
  EXPECT_LT(grid->getConstAccessor().getValue({24, 23, 22}), 0);
  EXPECT_GT(grid->getConstAccessor().getValue({1, 1, 1}), 0);
  convert_file("x.vdb", "d");
  expect_volume("d");
}

TEST_F(ExportVdb, InsideBelowIsWhatIsNotInsideAboveButNaN) {
  MemorySource source = make_source<float>({20, 18, 17}, 1, true);
  convert_to(source, "a", 16);
  const auto written = [&](Inside inside) {
    NoProgress none;
    export_volume(StoreReader(folder_ / "a"), folder_ / "x.vdb",
                  {.format = ExportFormat::vdb, .isovalue = 0.5, .inside = inside, .force = true},
                  none);
    openvdb::io::File file((folder_ / "x.vdb").string());
    file.open();
    return openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("surface"));
  };
  const auto above = written(Inside::above), below = written(Inside::below);
  std::vector<float> samples(source.samples().size() / sizeof(float));
  std::memcpy(samples.data(), source.samples().data(), source.samples().size());
  for_each_point({{0, 0, 0}, {20, 18, 17}}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    const float sample = samples[static_cast<std::size_t>(linear_index(p, {20, 18, 17}))];
    ASSERT_EQ(above->getConstAccessor().getValue(at) < 0, sample >= 0.5F) << sample;
    ASSERT_EQ(below->getConstAccessor().getValue(at) < 0, sample < 0.5F) << sample;
  });
}

TEST_F(ExportVdb, DistancesAreThoseFromTheMesh) {
  // Noise, spacings that differ, integers, samples that are the isovalue.
  const Int3 extent{14, 11, 12};
  MemorySource source = make_source<std::uint8_t>(extent, 3);
  source.mutable_info().transform.spacing = {1, 0.75, 1.25};
  convert_to(source, "a", 16);
  const StoreReader store(folder_ / "a");
  const double isovalue = 128;
  TriangleList mesh;
  NoProgress none;
  extract(store, {.isovalue = isovalue, .backend = Backend::cpu}, mesh, none);
  ASSERT_GT(mesh.corners.size(), 3000U);
  const auto grid = level_set("a", isovalue, 1);
  const auto accessor = grid->getConstAccessor();
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    const openvdb::Vec3d world = grid->indexToWorld(at);
    double nearest = 1.25;
    for (std::size_t i = 0; i < mesh.corners.size(); i += 3) {
      openvdb::Vec3d weights;
      const openvdb::Vec3d there = openvdb::math::closestPointOnTriangleToPoint(
          mesh.corners[i], mesh.corners[i + 1], mesh.corners[i + 2], world, weights);
      nearest = std::min(nearest, (there - world).length());
    }
    const auto sample =
        std::to_integer<int>(source.samples()[static_cast<std::size_t>(linear_index(p, extent))]);
    const auto value = static_cast<double>(accessor.getValue(at));
    ASSERT_NEAR(std::abs(value), nearest, 1e-5) << p.x << ' ' << p.y << ' ' << p.z;
    ASSERT_EQ(value < 0, sample >= isovalue) << p.x << ' ' << p.y << ' ' << p.z;
  });
}

TEST_F(ExportVdb, BricksAndPiecesDoNotShow) {
  MemorySource source = make_source<float>({61, 45, 52}, 5, true);  // NaN and infinities, too
  convert_to(source, "a", 16);
  convert_to(source, "b", 36);
  const auto a = level_set("a", 0.5), b = level_set("b", 0.5);
  EXPECT_GT(a->activeVoxelCount(), 1000U);
  EXPECT_EQ(a->activeVoxelCount(), b->activeVoxelCount());
  const auto of_a = a->getConstAccessor(), of_b = b->getConstAccessor();
  for_each_point({{0, 0, 0}, {61, 45, 52}}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    ASSERT_EQ(of_a.getValue(at), of_b.getValue(at)) << p.x << ' ' << p.y << ' ' << p.z;
    ASSERT_EQ(of_a.isValueOn(at), of_b.isValueOn(at)) << p.x << ' ' << p.y << ' ' << p.z;
  });
}

TEST_F(ExportVdb, RegionsLieWhereTheyAre) {
  MemorySource source = sphere();
  convert_to(source, "a", 16);
  const auto whole = level_set("a", 0);
  const Box3 roi{{19, 3, 2}, {50, 46, 45}};  // cuts the sphere
  const auto part = level_set("a", 0, 3, roi);
  const auto of_whole = whole->getConstAccessor(), of_part = part->getConstAccessor();
  // Away from where the surface is cut.
  for_each_point({{19 + 4, 3, 2}, roi.hi}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    const Int3 q = p - roi.lo;
    const openvdb::Coord in(static_cast<int>(q.x), static_cast<int>(q.y), static_cast<int>(q.z));
    ASSERT_TRUE(whole->indexToWorld(at).eq(part->indexToWorld(in)));
    ASSERT_NEAR(of_whole.getValue(at), of_part.getValue(in), 1e-5);
  });
}

TEST_F(ExportVdb, RefusesWhatMakesNoSense) {
  MemorySource source = sphere();
  convert_to(source, "a", 16);
  const StoreReader store(folder_ / "a");
  NoProgress none;
  const auto write = [&](const ExportOptions& options) {
    export_volume(store, folder_ / "x.vdb", options, none);
  };
  EXPECT_THROW(write({.isovalue = 0}), UsageError);
  EXPECT_THROW(write({.format = ExportFormat::vdb, .isovalue = 0, .half_band = 0}), UsageError);
  EXPECT_THROW(write({.format = ExportFormat::vdb, .isovalue = std::nan("")}), UsageError);
  EXPECT_THROW(write({.format = ExportFormat::vdb, .isovalue = 0, .memory = 42 * kMiB}),
               UsageError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.vdb"));
}

TEST_F(ExportVdb, WideBandsListAFewTrianglesAtATime) {
  // 25³ leaves near each triangle: 33 MiB, and of all triangles 33 MiB of pairs.
  VolumeInfo info;
  info.extent = {200, 200, 200};
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < 140; ++i) {
    const auto at = 100 + 0.01F * static_cast<float>(i);
    for (const Vec3f p : {Vec3f{0, 0, 0}, Vec3f{1, 0, 0}, Vec3f{0, 1, 0}})
      positions.push_back(p + Vec3f{at, at, at});
    triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  make_vdb_level_set_if_built(info, "a", 100, 2, 80 * kMiB)->add(positions, triangles);
  const auto small = make_vdb_level_set_if_built(info, "a", 100, 2, 30 * kMiB);
  try {
    small->add(positions, triangles);
    FAIL() << "the budget was not kept";
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("more than the 30 MiB"), std::string::npos) << e.what();
  }
}

TEST_F(ExportVdb, ZerosKeepTheirSigns) {
  const Int3 extent{40, 20, 20};
  std::vector<float> samples(static_cast<std::size_t>(volume(extent)), 0.0F);
  samples[3] = -0.0F;                                       // beside zeros
  for_each_point({{16, 0, 0}, {32, 16, 16}}, [&](Int3 p) {  // a whole brick
    samples[static_cast<std::size_t>(linear_index(p, extent))] = -0.0F;
  });
  MemorySource source(extent, ScalarType::f32, as_bytes(samples));
  convert_to(source, "a", 16);
  NoProgress none;
  export_volume(StoreReader(folder_ / "a"), folder_ / "x.vdb", {.format = ExportFormat::vdb}, none);
  openvdb::io::File file((folder_ / "x.vdb").string());
  file.open();
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("density"));
  const auto accessor = grid->getConstAccessor();
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    const openvdb::Coord at(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z));
    ASSERT_EQ(std::signbit(accessor.getValue(at)),
              std::signbit(samples[static_cast<std::size_t>(linear_index(p, extent))]))
        << p.x << ' ' << p.y << ' ' << p.z;
  });
}

TEST_F(ExportVdb, KeepsTheNameOfAGrid) {
  MemorySource source = make_source<float>({20, 20, 20}, 2);
  convert_to(source, "a", 16);
  source.mutable_info().grid_name = "temperature";
  convert_to(source, "b", 16);
  for (const auto& [store, name] : {std::pair{"a", "density"}, std::pair{"b", "temperature"}}) {
    NoProgress none;
    export_volume(StoreReader(folder_ / store), folder_ / "x.vdb",
                  {.format = ExportFormat::vdb, .force = true}, none);
    openvdb::io::File file((folder_ / "x.vdb").string());
    file.open();
    EXPECT_TRUE(file.hasGrid(name)) << name;
  }
}

}  // namespace
}  // namespace isobrick

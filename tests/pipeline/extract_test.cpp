#include <isobrick/extract.h>

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include "tests/pipeline/convert_doubles.h"
#include "tests/pipeline/least_budget.h"
#include "tests/surface/field.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using isobrick::testing::Field;
using isobrick::testing::Mesh;

/// Keeps the mesh; may fail in the middle.
class MemorySink final : public MeshSink {
 public:
  explicit MemorySink(Indexing indexing = Indexing::welded) : indexing_(indexing) {}
  Indexing indexing() const override { return indexing_; }
  void begin(const MeshHeader& header) override { header_ = header; }
  void write(const MeshChunk& chunk) override {
    EXPECT_EQ(chunk.first_vertex, mesh.positions.size());
    largest_chunk = std::max(largest_chunk, chunk.positions.size() * sizeof(Vec3f) +
                                                chunk.triangles.size() * sizeof(Triangle));
    if (++chunks == fail_at) throw Error("the sink broke");
    mesh.positions.insert(mesh.positions.end(), chunk.positions.begin(), chunk.positions.end());
    mesh.normals.insert(mesh.normals.end(), chunk.normals.begin(), chunk.normals.end());
    mesh.triangles.insert(mesh.triangles.end(), chunk.triangles.begin(), chunk.triangles.end());
  }
  void finish() override { finished = true; }
  std::uint64_t bytes() const override { return 0; }

  Mesh mesh;
  MeshHeader header_;
  int chunks = 0, fail_at = -1;
  std::size_t largest_chunk = 0;
  bool finished = false;

 private:
  Indexing indexing_;
};

class Extract : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = fs::temp_directory_path() / ("isobrick-extract-" + std::to_string(::getpid()));
    fs::remove_all(dir_);
    fs::create_directories(dir_);
  }
  void TearDown() override { fs::remove_all(dir_); }

  template <class T>
  StoreReader store(const Field<T>& field, const ConvertOptions& options) {
    MemorySource source(field.extent, scalar_type_of<T>, as_bytes(field.samples));
    source.mutable_info().transform.spacing = {0.5, 1, 2};
    const fs::path path = dir_ / ("s" + std::to_string(next_++) + ".zarr");
    NoProgress silent;
    convert(source, path, options, silent);
    return StoreReader(path);
  }

  static ExtractReport run(const StoreReader& store, const ExtractOptions& options,
                           MeshSink& sink) {
    NoProgress silent;
    return extract(store, options, sink, silent);
  }

  fs::path dir_;
  int next_ = 0;
};

/// Noise with calm regions, outside at the border.
template <class T>
Field<T> mixed_field(Int3 extent) {
  auto field = isobrick::testing::padded_noise<T>(extent, 0, 100, T{0}, 17);
  for_each_point({{10, 10, 10}, {extent.x - 20, 90, extent.z - 5}}, [&](Int3 p) {
    field.at(p) =
        static_cast<T>(p.x < 70 ? 95 : 50 + 40 * std::sin(static_cast<double>(p.x + 2 * p.y) / 9));
  });
  return field;
}

/// What a picture frames while the mesh is being made.
TEST_F(Extract, TheHeaderBoundsTheSurfaceWithinTheRegion) {
  const Field<float> field({128, 128, 96}, [](Int3 p) {
    const Int3 d = p - Int3{100, 30, 70};
    return 10 - std::sqrt(static_cast<double>(d.x * d.x + d.y * d.y + d.z * d.z));
  });
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  const Vec3d spacing{0.5, 1, 2};
  for (const std::optional<Box3> roi :
       {std::optional<Box3>(), std::optional(Box3{{95, 0, 0}, {128, 31, 70}})}) {
    MemorySink sink;
    run(reader, {.roi = roi}, sink);
    ASSERT_FALSE(sink.mesh.positions.empty());
    ASSERT_TRUE(sink.header_.surface);
    const MeshBounds bounds = *sink.header_.surface;
    for (int axis = 0; axis < 3; ++axis) {
      double lo = 1e9, hi = -1e9;
      for (const Vec3f& p : sink.mesh.positions) {
        lo = std::min(lo, static_cast<double>(p[axis]));
        hi = std::max(hi, static_cast<double>(p[axis]));
      }
      EXPECT_LE(bounds.lo[axis], lo);
      EXPECT_GE(bounds.hi[axis], hi);
      EXPECT_GT(bounds.lo[axis], lo - 16 * spacing[axis]);
      EXPECT_LT(bounds.hi[axis], hi + 16 * spacing[axis]);
      if (!roi) continue;
      EXPECT_GE(bounds.lo[axis], static_cast<double>(roi->lo[axis]) * spacing[axis]);
      EXPECT_LE(bounds.hi[axis], static_cast<double>(roi->hi[axis] - 1) * spacing[axis]);
    }
  }
}

TEST_F(Extract, TheMeshHasTheUnitOfTheStore) {
  Field<std::uint8_t> field{{9, 9, 9}};
  field.samples.assign(9 * 9 * 9, 1);
  for (const auto& [unit, expected] : {std::pair("micrometer", "micrometer"), std::pair("", "")}) {
    MemorySource source(field.extent, ScalarType::u8, as_bytes(field.samples));
    source.mutable_info().transform.unit = unit;
    const fs::path path = dir_ / (std::string("unit") + unit + ".zarr");
    NoProgress silent;
    convert(source, path, {}, silent);
    MemorySink sink;
    run(StoreReader(path), {.isovalue = 5}, sink);
    EXPECT_EQ(sink.header_.unit, expected);
  }
}

TEST_F(Extract, NothingButVolumeAndIsovalueShowsInTheMesh) {
  const auto field = mixed_field<std::uint8_t>({170, 131, 100});
  const double iso = 60;
  Mesh expected;
  for (const bool normals : {false, true}) {
    isobrick::testing::Request request{.isovalue = iso, .normals = normals};
    request.transform.spacing = {0.5, 1, 2};
    expected = isobrick::testing::extract(field, request);
    ASSERT_GT(expected.triangles.size(), 100000u);
    for (const Index brick : {16, 32, 64, 128}) {
      const StoreReader reader = store(field, {.brick = brick, .shard = 2 * brick});
      struct Means {
        int threads;
        std::uint64_t mib;
      };
      for (const auto [threads, mib] : {Means{1, 220}, Means{2, 1024}, Means{8, 220}}) {
        MemorySink sink;
        const ExtractReport report = run(
            reader, {.isovalue = iso, .normals = normals, .memory = mib << 20, .threads = threads},
            sink);
        ASSERT_EQ(sink.mesh, expected)
            << "brick " << brick << " threads " << threads << " MiB " << mib;
        EXPECT_TRUE(sink.finished);
        EXPECT_EQ(report.triangles, expected.triangles.size());
        EXPECT_EQ(report.vertices, expected.positions.size());
        EXPECT_LE(report.bricks_read, report.bricks);
      }
    }
  }
}

TEST_F(Extract, LeavesDegenerateTrianglesOutWhateverTheBudget) {
  const auto field = mixed_field<std::uint8_t>({140, 120, 90});
  isobrick::testing::Request request{.isovalue = 60, .drop_degenerate = true};
  request.transform.spacing = {0.5, 1, 2};
  Mesh expected = isobrick::testing::extract(field, request);
  const std::uint64_t left_out = expected.degenerate;
  ASSERT_GT(left_out, 1000u);
  expected.degenerate = 0;  // sinks do not get that number
  for (const Index brick : {16, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 64});
    for (const std::uint64_t memory : {std::uint64_t{160} << 20, std::uint64_t{1} << 30}) {
      MemorySink sink;
      const ExtractReport report = run(
          reader, {.isovalue = 60, .drop_degenerate = true, .memory = memory, .threads = 2}, sink);
      EXPECT_EQ(sink.mesh, expected);
      EXPECT_EQ(report.triangles, expected.triangles.size());
      EXPECT_EQ(report.degenerate_triangles, left_out);
    }
  }
}

TEST_F(Extract, FollowsTheInterpolantWhateverTheBudget) {
  const auto field = mixed_field<std::uint8_t>({140, 120, 90});
  constexpr Topology trilinear = Topology::trilinear;
  isobrick::testing::Request request{.isovalue = 60, .normals = true, .topology = trilinear};
  request.transform.spacing = {0.5, 1, 2};
  const Mesh expected = isobrick::testing::extract(field, request);
  request.topology = Topology::consistent;
  ASSERT_GT(expected.positions.size(),
            isobrick::testing::extract(field, request).positions.size() + 1000);
  for (const Index brick : {16, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 64});
    ExtractOptions options{.isovalue = 60, .normals = true, .topology = trilinear, .threads = 2};
    const std::uint64_t least = min_extract_memory(reader, options, Indexing::welded, 0);
    for (const std::uint64_t memory : {least, std::uint64_t{1} << 30}) {
      MemorySink sink;
      options.memory = memory;
      const ExtractReport report = run(reader, options, sink);
      EXPECT_EQ(sink.mesh, expected);
      EXPECT_EQ(report.triangles, expected.triangles.size());
    }
  }
}

TEST_F(Extract, TheLeastBudgetWorksAndLessIsRefusedByName) {
  const auto field = mixed_field<std::uint16_t>({140, 120, 90});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  MemorySink roomy, tight;
  run(reader, {.isovalue = 60, .threads = 2}, roomy);
  std::uint64_t least = 0;
  try {
    run(reader, {.isovalue = 60, .memory = 1 << 20, .threads = 2}, tight);
    FAIL();
  } catch (const UsageError& e) {
    least = least_budget_in(e.what());
  }
  MemorySink least_sink;
  const ExtractReport report =
      run(reader, {.isovalue = 60, .memory = least, .threads = 2}, least_sink);
  EXPECT_EQ(least_sink.mesh, roomy.mesh);
  EXPECT_GE(report.brick_reads, report.bricks_read);
  MemorySink refused;
  EXPECT_THROW(run(reader, {.isovalue = 60, .memory = least - (1 << 20), .threads = 2}, refused),
               UsageError);
}

TEST_F(Extract, OnlyTouchedBricksAreRead) {
  const Field<std::uint8_t> field({256, 64, 64}, [](Int3 p) { return p.x < 70 ? 200 : 10; });
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  MemorySink sink;
  const ExtractReport report = run(reader, {.isovalue = 100}, sink);
  EXPECT_EQ(report.bricks, 32u);
  EXPECT_EQ(report.active_bricks, 4u);
  EXPECT_EQ(report.bricks_read, 4u);  // 64 … 95 holds both sides
  EXPECT_EQ(report.triangles, std::uint64_t{2} * 63 * 63);
  MemorySink empty;
  EXPECT_EQ(run(reader, {.isovalue = 220}, empty).bricks_read, 0u);
  EXPECT_TRUE(empty.finished);
}

TEST_F(Extract, LevelsAndRegionsAreExtractedFromTheirSamples) {
  const auto field = mixed_field<float>({130, 100, 90});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  ASSERT_GE(reader.info().levels.size(), 2u);
  MemorySink coarse;
  const ExtractReport report = run(reader, {.isovalue = 60, .level = 1}, coarse);
  EXPECT_GT(report.triangles, 1000u);
  const Box3 roi{{20, 30, 10}, {101, 77, 80}};
  MemorySink part;
  run(reader, {.isovalue = 60.01, .roi = roi}, part);
  isobrick::testing::Request request{.isovalue = 60.01, .roi = roi};
  request.transform.spacing = {0.5, 1, 2};
  EXPECT_EQ(part.mesh, isobrick::testing::extract(field, request));
  MemorySink none;
  EXPECT_THROW(run(reader, {.isovalue = 60, .level = 9}, none), UsageError);
  EXPECT_THROW(run(reader, {.isovalue = 60, .roi = Box3{{0, 0, 0}, {131, 1, 1}}}, none),
               UsageError);
  EXPECT_THROW(run(reader, {.isovalue = 60, .roi = Box3{{5, 5, 5}, {5, 9, 9}}}, none), UsageError);
  EXPECT_THROW(run(reader, {.isovalue = NAN}, none), UsageError);
}

TEST_F(Extract, VolumesWithNaNEqualTheMeshInMemory) {
  auto field = mixed_field<float>({100, 90, 80});
  std::mt19937 random(3);
  for_each_point({{0, 0, 0}, {100, 50, 80}}, [&](Int3 p) {
    if (random() % 30 == 0) field.at(p) = NAN;
  });
  for_each_point({{40, 0, 0}, {64, 90, 80}}, [&](Int3 p) { field.at(p) = NAN; });
  isobrick::testing::Request request{.isovalue = 60.01};
  request.transform.spacing = {0.5, 1, 2};
  const Mesh expected = isobrick::testing::extract(field, request);
  for (const Index brick : {16, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 64});
    EXPECT_TRUE(reader.info().may_have_nan);
    MemorySink sink;
    run(reader, {.isovalue = 60.01}, sink);
    EXPECT_EQ(sink.mesh, expected);
  }
}

TEST_F(Extract, ALostShardIsNoEmptySpace) {
  const auto field = mixed_field<std::uint8_t>({140, 120, 90});
  const StoreReader whole = store(field, {.brick = 16, .shard = 32});
  const auto lost = whole.locate(0, {6, 3, 2});
  ASSERT_TRUE(lost);
  fs::remove(whole.storage()->local_path() / lost->key);
  MemorySink sink;
  EXPECT_THROW(run(StoreReader(whole.storage()), {.isovalue = 60}, sink), DamageError);
  EXPECT_FALSE(sink.finished);
}

TEST_F(Extract, SpacingThatNoFloatHoldsIsRefused) {
  const Field<std::uint8_t> field({20, 20, 20}, [](Int3 p) { return static_cast<double>(p.x); });
  for (const double spacing : {1e39, 1e-39, 1e300}) {
    MemorySource source(field.extent, ScalarType::u8, as_bytes(field.samples));
    source.mutable_info().transform.spacing = {1, spacing, 1};
    const fs::path path = dir_ / "far.zarr";
    NoProgress silent;
    convert(source, path, {.force = true}, silent);
    MemorySink sink;
    EXPECT_THROW(run(StoreReader(path), {.isovalue = 5}, sink), Error) << spacing;
  }
}

TEST_F(Extract, ASinkThatFailsStopsItAndIsNotFinished) {
  const auto field = mixed_field<std::uint8_t>({140, 120, 90});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  for (const int at : {1, 2, 3}) {
    MemorySink sink;
    sink.fail_at = at;
    EXPECT_THROW(
        run(reader, {.isovalue = 60, .memory = std::uint64_t{80} << 20, .threads = 1}, sink),
        Error);
    EXPECT_FALSE(sink.finished);
  }
}

TEST_F(Extract, ChunksKeepToTheBudget) {
  const auto field = isobrick::testing::padded_noise<std::uint8_t>({200, 200, 100}, 0, 255, 0, 5);
  const StoreReader reader = store(field, {.brick = 64, .shard = 128});
  MemorySink sink;
  run(reader, {.isovalue = 128, .memory = std::uint64_t{96} << 20, .threads = 1}, sink);
  EXPECT_LT(sink.largest_chunk, std::size_t{12} << 20);
  EXPECT_GT(isobrick::testing::closed_sides(sink.mesh), 0);
}

}  // namespace
}  // namespace isobrick::test

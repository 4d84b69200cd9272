#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/extract.h>
#include <isobrick/index_build.h>
#include "pipeline/extract/extract_plan.h"
#include "pipeline/extract/extract_tiles.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/least_budget.h"
#include "tests/surface/field.h"

// Several surfaces of one store in one extraction: each is what it is alone.

namespace isobrick::test {
namespace {

using isobrick::testing::Field;

/// Keeps a welded mesh as it comes, and of one whose chunks stand alone the corners of its
/// triangles.
class KeptMesh final : public MeshSink {
 public:
  explicit KeptMesh(Indexing indexing, std::uint64_t memory = 0, int fail_at = -1)
      : indexing_(indexing), memory_(memory), fail_at_(fail_at) {}

  Indexing indexing() const override { return indexing_; }
  void begin(const MeshHeader& header) override {
    begun = true;
    has_normals_ = header.has_normals;
  }
  void write(const MeshChunk& chunk) override {
    if (++chunks_ == fail_at_) throw Error("the sink broke");
    EXPECT_EQ(has_normals_, !chunk.normals.empty() || chunk.positions.empty());
    if (indexing_ == Indexing::welded) {
      append(vertices_, std::as_bytes(chunk.positions));
      append(normals_, std::as_bytes(chunk.normals));
      append(triangles_, std::as_bytes(chunk.triangles));
      return;
    }
    for (const Triangle& triangle : chunk.triangles)
      for (const std::uint32_t corner : triangle) {
        append(vertices_, std::as_bytes(chunk.positions.subspan(corner, 1)));
        if (has_normals_) append(normals_, std::as_bytes(chunk.normals.subspan(corner, 1)));
      }
  }
  void finish() override { finished = true; }
  std::uint64_t bytes() const override { return 0; }
  std::uint64_t memory() const override { return memory_; }
  std::string mesh() const { return vertices_ + normals_ + triangles_; }

  bool begun = false, finished = false;

 private:
  static void append(std::string& to, std::span<const std::byte> bytes) {
    to.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  Indexing indexing_;
  std::uint64_t memory_;
  int fail_at_, chunks_ = 0;
  bool has_normals_ = false;
  std::string vertices_, normals_, triangles_;
};

/// A requested surface.
struct SurfaceRequest {
  double isovalue;
  bool normals;
  Indexing indexing = Indexing::welded;
};

struct Made {
  std::vector<std::string> meshes;
  std::vector<ExtractReport> reports;
};

Made make_together(const StoreReader& store, const ExtractOptions& options,
                   const std::vector<SurfaceRequest>& requests) {
  std::vector<KeptMesh> sinks;
  for (const SurfaceRequest& r : requests) sinks.emplace_back(r.indexing);
  std::vector<SurfaceOutput> outputs;
  for (std::size_t i = 0; i < requests.size(); ++i)
    outputs.push_back({requests[i].isovalue, requests[i].normals, &sinks[i]});
  NoProgress silent;
  Made made{.meshes = {}, .reports = extract(store, options, outputs, silent)};
  for (const KeptMesh& sink : sinks) {
    EXPECT_TRUE(sink.finished);
    made.meshes.push_back(sink.mesh());
  }
  return made;
}

Made make_alone(const StoreReader& store, ExtractOptions options,
                const std::vector<SurfaceRequest>& requests) {
  Made made;
  for (const SurfaceRequest& r : requests) {
    KeptMesh sink(r.indexing);
    options.isovalue = r.isovalue;
    options.normals = r.normals;
    NoProgress silent;
    made.reports.push_back(extract(store, options, sink, silent));
    made.meshes.push_back(sink.mesh());
  }
  return made;
}

void expect_same(const Made& together, const Made& alone) {
  ASSERT_EQ(together.meshes.size(), alone.meshes.size());
  for (std::size_t i = 0; i < alone.meshes.size(); ++i) {
    SCOPED_TRACE("surface " + std::to_string(i));
    EXPECT_TRUE(together.meshes[i] == alone.meshes[i]);
    const ExtractReport &a = together.reports[i], &b = alone.reports[i];
    EXPECT_EQ(a.triangles, b.triangles);
    EXPECT_EQ(a.vertices, b.vertices);
    EXPECT_EQ(a.degenerate_triangles, b.degenerate_triangles);
    EXPECT_EQ(a.active_bricks, b.active_bricks);
  }
}

/// A mesh with its picture, and other isovalues, one of which no sample reaches.
const std::vector<SurfaceRequest> kRequests{{60, true},
                                            {60, true, Indexing::chunk_local},
                                            {30.5, false},
                                            {300, true},
                                            {90, false, Indexing::chunk_local}};

/// Noise in one half, waves in the other.
template <class T>
Field<T> noise_and_waves(Int3 extent) {
  auto field = isobrick::testing::padded_noise<T>(extent, 0, 100, T{0}, 17);
  for_each_point({{0, 0, 0}, {extent.x / 2, extent.y, extent.z}}, [&](Int3 p) {
    field.at(p) = static_cast<T>(50 + 45 * std::sin(static_cast<double>(p.x + 2 * p.y + p.z) / 9));
  });
  return field;
}

class ExtractTogether : public ::testing::Test {
 protected:
  template <class T>
  StoreReader store(const Field<T>& field, const ConvertOptions& options) {
    MemorySource source(field.extent, scalar_type_of<T>, as_bytes(field.samples));
    source.mutable_info().transform.spacing = {0.5, 1, 2};
    const auto path = folder_ / ("s" + std::to_string(next_++) + ".zarr").c_str();
    convert_quietly(source, path, options);
    return StoreReader(path);
  }

  TemporaryFolder folder_;
  int next_ = 0;
};

TEST_F(ExtractTogether, EverySurfaceIsWhatItIsAlone) {
  const auto field = noise_and_waves<std::uint8_t>({100, 81, 70});
  for (const Index brick : {16, 32, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 2 * brick});
    const Made alone = make_alone(reader, {.threads = 2}, kRequests);
    EXPECT_GT(alone.reports[0].triangles, 50000u);
    EXPECT_EQ(alone.reports[3].triangles, 0u);
    for (const int threads : {1, 8})
      for (const std::uint64_t memory : {std::uint64_t{110} << 20, std::uint64_t{1} << 30}) {
        SCOPED_TRACE(std::to_string(brick) + ", threads " + std::to_string(threads));
        expect_same(make_together(reader, {.memory = memory, .threads = threads}, kRequests),
                    alone);
      }
  }
}

TEST_F(ExtractTogether, WhateverFindsTheActiveBlocks) {
  const auto field = noise_and_waves<std::uint16_t>({90, 81, 70});
  const StoreReader plain = store(field, {.brick = 32, .shard = 64});
  for (const IndexKind kind :
       {IndexKind::interval, IndexKind::kdtree, IndexKind::quadtree, IndexKind::octree}) {
    NoProgress silent;
    add_index(plain.storage()->local_path(), {.kind = kind, .leaf = 8, .threads = 2}, silent);
  }
  const StoreReader reader(plain.storage()->local_path());
  const IndexChoice ranges{.automatic = false, .kind = {}};
  const Made alone = make_alone(reader, {.threads = 2, .index = ranges}, kRequests);
  for (const IndexKind kind :
       {IndexKind::interval, IndexKind::kdtree, IndexKind::quadtree, IndexKind::octree}) {
    SCOPED_TRACE(name_of(kind));
    const Made made = make_together(
        reader, {.threads = 2, .index = {.automatic = false, .kind = kind}}, kRequests);
    expect_same(made, alone);
    EXPECT_EQ(made.reports[0].index, kind);
  }
  expect_same(make_together(reader, {.threads = 2}, kRequests), alone);
}

/// Extractors share work spaces whether their isovalue equals samples or not.
TEST_F(ExtractTogether, DegenerateTrianglesAreLeftOutOfEach) {
  const std::vector<SurfaceRequest> requests{
      {60, true}, {60.5, false}, {50, false, Indexing::chunk_local}};
  const auto field = noise_and_waves<std::uint8_t>({100, 81, 70});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  const ExtractOptions options{.drop_degenerate = true, .threads = 2};
  const Made alone = make_alone(reader, options, requests);
  EXPECT_GT(alone.reports[0].degenerate_triangles, 0u);
  EXPECT_EQ(alone.reports[1].degenerate_triangles, 0u);
  expect_same(make_together(reader, options, requests), alone);
}

TEST_F(ExtractTogether, EachFollowsTheInterpolant) {
  const auto field = noise_and_waves<std::uint8_t>({100, 81, 70});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  for (const bool drop : {false, true}) {
    const ExtractOptions options{
        .drop_degenerate = drop, .topology = Topology::trilinear, .threads = 2};
    expect_same(make_together(reader, options, kRequests), make_alone(reader, options, kRequests));
  }
}

TEST_F(ExtractTogether, RegionsLevelsAndNaN) {
  auto field = noise_and_waves<float>({100, 90, 80});
  for_each_point({{30, 10, 20}, {60, 40, 50}}, [&](Int3 p) {
    if ((p.x + p.y * 7 + p.z * 3) % 11 == 0) field.at(p) = NAN;
  });
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  ASSERT_TRUE(reader.info().may_have_nan);
  for (const ExtractOptions& options :
       {ExtractOptions{.threads = 2},
        ExtractOptions{.roi = Box3{{20, 30, 10}, {77, 71, 66}}, .threads = 2},
        ExtractOptions{.level = 1, .threads = 2}})
    expect_same(make_together(reader, options, kRequests), make_alone(reader, options, kRequests));
}

/// The stored bricks that surfaces need.
std::set<std::tuple<Index, Index, Index>> needed_bricks(
    const StoreReader& store, const std::vector<SurfaceRequest>& requests) {
  std::set<std::tuple<Index, Index, Index>> needed;
  for (const SurfaceRequest& r : requests) {
    const ExtractRequest request = check_request(
        store, {.isovalue = r.isovalue, .normals = r.normals, .threads = 1}, r.indexing);
    TileStream tiles = tiles_of(store, 0, {&request, 1});
    BatchPlanner planner(tiles, request.level->lattice, sample_reach(request.surface), false,
                         1 << 14, 1 << 20);
    for (TileBatch batch; planner.next(batch);)
      for (const Int3 b : batch.bricks)
        if (store.locate(0, b)) needed.emplace(b.x, b.y, b.z);
  }
  return needed;
}

TEST_F(ExtractTogether, EveryBrickIsReadAndDecodedOnce) {
  const auto field = noise_and_waves<std::uint16_t>({90, 70, 66});
  for (const Index brick : {16, 32}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 2 * brick});
    const std::uint64_t brick_bytes = reader.info().levels[0].lattice.brick_bytes();
    const std::uint64_t needed = needed_bricks(reader, kRequests).size();
    const BrickTimes before = reader.brick_times();
    const Made together = make_together(reader, {.threads = 2}, kRequests);
    EXPECT_EQ(reader.brick_times().bytes_decoded - before.bytes_decoded, needed * brick_bytes);
    for (const ExtractReport& report : together.reports) {
      EXPECT_EQ(report.pass, 0u);
      EXPECT_EQ(report.bricks_read, needed);
      EXPECT_EQ(report.brick_reads, needed);
      EXPECT_EQ(report.bytes_read, together.reports[0].bytes_read);
    }
    std::uint64_t alone = 0;
    for (const ExtractReport& report : make_alone(reader, {.threads = 2}, kRequests).reports)
      alone += report.bytes_read;
    EXPECT_LT(2 * together.reports[0].bytes_read, alone);
  }
}

/// Of a budget with room for one surface at a time, or for two.
TEST_F(ExtractTogether, ABudgetWithoutRoomForAllTakesMorePasses) {
  const auto field = noise_and_waves<std::uint8_t>({100, 81, 70});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  const Made alone = make_alone(reader, {.threads = 2}, kRequests);
  std::uint64_t least = 0;
  try {
    make_together(reader, {.memory = 1 << 20, .threads = 2}, kRequests);
    FAIL();
  } catch (const UsageError& e) {
    least = least_budget_in(e.what());
  }
  const Made one_by_one = make_together(reader, {.memory = least, .threads = 2}, kRequests);
  expect_same(one_by_one, alone);
  for (std::size_t i = 0; i < kRequests.size(); ++i) EXPECT_EQ(one_by_one.reports[i].pass, i);
  const std::uint64_t of_surface =
      2 * CpuExtractor::max_tile_output(true, Topology::consistent) + (std::uint64_t{4} << 20);
  const Made in_pairs =
      make_together(reader, {.memory = least + of_surface, .threads = 2}, kRequests);
  expect_same(in_pairs, alone);
  EXPECT_EQ(in_pairs.reports[1].pass, 0u);
  EXPECT_EQ(in_pairs.reports[2].pass, 1u);
  EXPECT_EQ(in_pairs.reports[4].pass, 2u);
  EXPECT_EQ(in_pairs.reports[0].bytes_read, in_pairs.reports[1].bytes_read);
}

TEST_F(ExtractTogether, ABudgetTooSmallForOneSurfaceBeginsNone) {
  const auto field = noise_and_waves<std::uint8_t>({60, 50, 40});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  KeptMesh small(Indexing::welded), large(Indexing::welded, std::uint64_t{1} << 30);
  const std::vector<SurfaceOutput> outputs{{60, false, &small}, {30, false, &large}};
  NoProgress silent;
  EXPECT_THROW(extract(reader, {.memory = std::uint64_t{256} << 20, .threads = 2}, outputs, silent),
               UsageError);
  EXPECT_FALSE(small.begun);
  EXPECT_FALSE(large.begun);
  EXPECT_TRUE(extract(reader, {}, std::vector<SurfaceOutput>{}, silent).empty());
}

TEST_F(ExtractTogether, ASinkThatFailsEndsAllOfItsPass) {
  const auto field = noise_and_waves<std::uint8_t>({100, 81, 70});
  const StoreReader reader = store(field, {.brick = 32, .shard = 64});
  for (const int at : {1, 2}) {
    KeptMesh whole(Indexing::welded), broken(Indexing::welded, 0, at);
    const std::vector<SurfaceOutput> outputs{{60, false, &whole}, {30, false, &broken}};
    NoProgress silent;
    EXPECT_THROW(extract(reader, {.threads = 1}, outputs, silent), Error);
    EXPECT_FALSE(whole.finished);
    EXPECT_FALSE(broken.finished);
  }
}

}  // namespace
}  // namespace isobrick::test

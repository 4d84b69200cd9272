#include <isobrick/pieces.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/mesh_filters.h>
#include <isobrick/mesh_sinks.h>
#include "pipeline/pieces/merge_limit.h"
#include "tests/pipeline/least_budget.h"
#include "tests/pipeline/pieces_fixture.h"

// Parts of a mesh, made alone and put together: the mesh of a single extraction.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using isobrick::testing::Field;

struct Case {
  const char* name;
  ExtractOptions options;
};

std::vector<Case> cases(Int3 extent) {
  const Box3 roi{{5, 33, 7}, {extent.x - 3, extent.y, 75}};
  return {
      {"plain", {.isovalue = 49.5}},
      {"normals", {.isovalue = 50, .normals = true}},
      {"drop", {.isovalue = 50, .normals = true, .drop_degenerate = true}},
      {"trilinear", {.isovalue = 49.5, .normals = true, .topology = Topology::trilinear}},
      {"drop trilinear",
       {.isovalue = 50, .drop_degenerate = true, .topology = Topology::trilinear}},
      {"cap", {.isovalue = 49.5, .normals = true, .cap = true}},
      {"cap trilinear", {.isovalue = 50, .roi = roi, .topology = Topology::trilinear, .cap = true}},
      {"region", {.isovalue = 49.5, .roi = roi, .normals = true}},
      {"drop region", {.isovalue = 50, .roi = roi, .drop_degenerate = true}},
      {"below", {.isovalue = 50, .inside = Inside::below, .cap = true}},
      {"level", {.isovalue = 40.25, .level = 1, .normals = true}},
      {"nothing", {.isovalue = 1000}}};
}

TEST_F(Pieces, BecomeTheMeshOfASingleExtraction) {
  const auto field = busy_field<std::uint8_t>({130, 97, 110});
  for (const Index brick : {16, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 64, .levels = 2});
    for (const Case& one : cases(field.extent)) {
      const PieceSink expected = whole(reader, one.options);
      for (const std::uint32_t count : {1u, 2u, 3u, 7u, 50u}) {
        SCOPED_TRACE(std::string(one.name) + ", " + std::to_string(count) + " parts");
        if (brick == 64 && count != 7) continue;
        expect_same(merged(pieces(reader, one.options, count)), expected);
      }
    }
  }
}

/// Takes numbers of 64 bits, and keeps them as they come.
class WideSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override { EXPECT_TRUE(header.wide); }
  void write(const MeshChunk& chunk) override {
    EXPECT_EQ(chunk.first_vertex, mesh.positions.size());
    EXPECT_TRUE(chunk.triangles.empty());
    mesh.positions.insert(mesh.positions.end(), chunk.positions.begin(), chunk.positions.end());
    mesh.normals.insert(mesh.normals.end(), chunk.normals.begin(), chunk.normals.end());
    for (const WideTriangle& t : chunk.wide_triangles) {
      mesh.triangles.emplace_back();
      for (std::size_t i = 0; i < 3; ++i)
        mesh.triangles.back()[i] = static_cast<std::uint32_t>(t[i]);
    }
    largest_chunk = std::max<std::size_t>(largest_chunk, chunk.positions.size_bytes() +
                                                             chunk.normals.size_bytes() +
                                                             chunk.wide_triangles.size_bytes());
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  PieceSink mesh;
  std::size_t largest_chunk = 0;
};

/// With a limit that a small mesh exceeds.
TEST_F(Pieces, OfMoreVerticesThan32BitsNumberHaveWideNumbers) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 49.5, .normals = true};
  const PieceSink expected = whole(reader, options);
  const auto paths = pieces(reader, options, 7);
  WideSink sink;
  const std::uint64_t limit = expected.positions.size() - 1;
  merge_pieces_within(limit, paths, sink, {}, no_progress());
  EXPECT_EQ(sink.mesh.positions, expected.positions);
  EXPECT_EQ(sink.mesh.normals, expected.normals);
  EXPECT_EQ(sink.mesh.triangles, expected.triangles);
  PieceSink narrow;
  merge_pieces_within(limit + 1, paths, narrow, {}, no_progress());
  expect_same(narrow, expected);
  EXPECT_THROW(merge_pieces_within(limit, paths, narrow, {}, no_progress()), Error);
}

TEST_F(Pieces, OfMoreVerticesThan32BitsNumberAreFiltered) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 49.5, .normals = true};
  const auto paths = pieces(reader, options, 3);
  const MeshFilterOptions filters{.largest = 2, .smooth = 2, .measure = true};
  const auto filtered = [&](std::uint64_t limit, PieceSink& sink) {
    MeshFilter filter(sink, filters);
    merge_pieces_within(limit, paths, filter, {}, no_progress());
    return filter.measure()->area;
  };
  PieceSink expected, found;
  const double area = filtered(kMaxNarrowVertices, expected);
  EXPECT_EQ(filtered(100, found), area);
  EXPECT_GT(expected.positions.size(), 1000u);
  expect_same(found, expected);
}

TEST_F(Pieces, BecomeTheMeshOfASingleExtractionWhereSamplesAreMissing) {
  auto field = busy_field<float>({130, 97, 110});
  std::mt19937 random(3);
  for (float& v : field.samples)
    if (random() % 500 == 0) v = std::numeric_limits<float>::quiet_NaN();
  const StoreReader reader = store(field, {.brick = 32, .shard = 64, .levels = 2});
  for (const Case& one : cases(field.extent)) {
    const PieceSink expected = whole(reader, one.options);
    for (const std::uint32_t count : {2u, 60u}) {
      SCOPED_TRACE(std::string(one.name) + ", " + std::to_string(count) + " parts");
      expect_same(merged(pieces(reader, one.options, count)), expected);
    }
  }
}

/// Also of several range chunks of 512 cells.
TEST_F(Pieces, OfThinAndWideVolumes) {
  for (const Int3 extent : {Int3{300, 2, 40}, Int3{1100, 40, 3}, Int3{34, 3, 1100},
                            Int3{530, 540, 35}, Int3{500, 180, 1}}) {
    const auto field = busy_field<std::uint16_t>(extent);
    const StoreReader reader = store(field);
    for (const bool drops : {false, true}) {
      const ExtractOptions options{.isovalue = 50, .drop_degenerate = drops};
      expect_same(merged(pieces(reader, options, 5)), whole(reader, options));
    }
  }
}

/// What parts hold is divided alike by all tasks, whatever they have.
TEST_F(Pieces, AreTheSameBytesForAllMeans) {
  const auto field = busy_field<std::uint8_t>({130, 97, 110});
  StoreReader reader = store(field, {.brick = 16, .shard = 64, .levels = 1});
  const fs::path path = folder_ / "s0.zarr";
  add_index(path, {.kind = IndexKind::octree});
  add_index(path, {.kind = IndexKind::interval, .leaf = 4});
  const StoreReader indexed(path);
  for (const bool drops : {false, true}) {
    ExtractOptions options{.isovalue = 50, .normals = true, .drop_degenerate = drops};
    options.threads = 2;
    const Part part{3, 7};
    const fs::path first = folder_ / "first.piece", other = folder_ / "other.piece";
    extract_piece(reader, options, part, first, true);
    const std::string expected = content_of_piece(first);
    EXPECT_GT(expected.size(), 10000u);
    const auto expect_equal = [&](const StoreReader& of, const ExtractOptions& with) {
      fs::remove(other);
      extract_piece(of, with, part, other);
      EXPECT_TRUE(content_of_piece(other) == expected);
    };
    ExtractOptions alone = options;
    alone.threads = 1;
    alone.memory = std::uint64_t{60} << 20;
    expect_equal(reader, alone);
    expect_equal(indexed, options);
    for (const IndexChoice choice :
         {IndexChoice{false, IndexKind::octree}, IndexChoice{false, IndexKind::interval}}) {
      ExtractOptions by_index = options;
      by_index.index = choice;
      expect_equal(indexed, by_index);
    }
    fs::remove(first);
  }
}

TEST_F(Pieces, AreBalanced) {
  const Field<float> field({200, 180, 160}, [](Int3 p) {
    return std::sin(static_cast<double>(p.x) / 5) * std::cos(static_cast<double>(p.y) / 5) +
           std::sin(static_cast<double>(p.y) / 5) * std::cos(static_cast<double>(p.z) / 5) +
           std::sin(static_cast<double>(p.z) / 5) * std::cos(static_cast<double>(p.x) / 5);
  });
  const StoreReader reader = store(field);
  const PieceSink all = whole(reader, {});
  for (const std::uint32_t count : {2u, 8u}) {
    const double share = static_cast<double>(all.triangles.size()) / count;
    for (std::uint32_t i = 1; i <= count; ++i) {
      const PieceReport report = extract_piece(reader, {}, {i, count}, folder_ / "one.piece", true);
      EXPECT_NEAR(static_cast<double>(report.surface.triangles), share, 0.25 * share);
    }
  }
}

TEST_F(Pieces, ComeInAnyOrder) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50};
  std::vector<fs::path> paths = pieces(reader, options, 6);
  const PieceSink expected = whole(reader, options);
  std::mt19937 random(1);
  for (int i = 0; i < 5; ++i) {
    std::shuffle(paths.begin(), paths.end(), random);
    expect_same(merged(paths), expected);
  }
}

TEST_F(Pieces, MayBeMergedWithoutNormals) {
  const StoreReader reader = store(busy_field<std::uint8_t>({70, 97, 60}));
  ExtractOptions options{.isovalue = 50, .normals = true};
  const auto paths = pieces(reader, options, 3);
  options.normals = false;
  expect_same(merged(paths, {.normals = false}), whole(reader, options));
}

TEST_F(Pieces, AreMergedWithinABudget) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 50};
  const auto paths = pieces(reader, options, 5);
  PieceSink sink;
  try {
    merge_pieces(paths, sink, {.memory = std::uint64_t{1} << 20});
    FAIL() << "merged in one MiB";
  } catch (const UsageError& refusal) {
    const std::uint64_t least = least_budget_in(refusal.what());
    EXPECT_GE(least, read_pieces(paths).merge_memory);
    const PieceSink small = merged(paths, {.memory = least});
    expect_same(small, whole(reader, options));
    EXPECT_LT(small.largest_chunk, std::size_t{2} << 20);
    EXPECT_THROW(merge_pieces(paths, sink, {.memory = read_pieces(paths).merge_memory - 1}),
                 UsageError);
  }
}

TEST_F(Pieces, CanBeCancelled) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const auto paths = pieces(reader, {.isovalue = 50}, 2);
  std::stop_source stop;
  stop.request_stop();
  PieceSink sink;
  EXPECT_THROW(merge_pieces(paths, sink, {.cancel = stop.get_token()}), Cancelled);
  EXPECT_FALSE(sink.finished);
}

TEST_F(Pieces, KnowWhatTheyBecome) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50, .drop_degenerate = true};
  const auto paths = pieces(reader, options, 4);
  PieceSink sink;
  const ExtractReport expected = extract(reader, options, sink);
  const PiecesInfo info = read_pieces(paths);
  EXPECT_EQ(info.size.vertices, expected.vertices);
  EXPECT_EQ(info.size.triangles, expected.triangles);
  EXPECT_EQ(info.degenerate, expected.degenerate_triangles);
  EXPECT_EQ(info.isovalue, 50);
  std::uint64_t bytes = 0;
  for (const fs::path& path : paths) bytes += fs::file_size(path);
  EXPECT_EQ(info.bytes, bytes);
}

}  // namespace
}  // namespace isobrick::test

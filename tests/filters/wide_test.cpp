#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/mesh_filters.h>
#include "filters/component_stage.h"
#include "filters/simplify_stage.h"
#include "filters/triangle_group.h"
#include "filters/vertex_sets.h"
#include "tests/filters/filter_fixture.h"

// Meshes whose vertices have numbers of 64 bits. Those of tests are small, and their header says so
// all the same.

namespace isobrick::test {
namespace {

/// Passes a mesh on as a wide one.
class Widening final : public MeshSink {
 public:
  explicit Widening(MeshSink& to) : to_(to) {}

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override {
    MeshHeader wide = header;
    wide.wide = true;
    to_.begin(wide);
  }
  void write(const MeshChunk& chunk) override {
    std::vector<WideTriangle> triangles;
    for (const Triangle& t : chunk.triangles) triangles.push_back({t[0], t[1], t[2]});
    MeshChunk wide = chunk;
    wide.triangles = {};
    wide.wide_triangles = triangles;
    to_.write(wide);
  }
  void finish() override { to_.finish(); }
  std::uint64_t bytes() const override { return 0; }

 private:
  MeshSink& to_;
};

/// Takes a mesh of either kind. Of chunks that stand alone, whose borders do not matter, each
/// triangle has vertices of its own.
class EitherSink final : public MeshSink {
 public:
  explicit EitherSink(Indexing indexing = Indexing::welded) : indexing_(indexing) {}

  Indexing indexing() const override { return indexing_; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override {
    is_wide = header.wide;
    sink_.begin(header);
  }
  void write(const MeshChunk& chunk) override {
    EXPECT_TRUE(is_wide ? chunk.triangles.empty() : chunk.wide_triangles.empty());
    std::vector<Triangle> triangles(chunk.triangles.begin(), chunk.triangles.end());
    for (const WideTriangle& t : chunk.wide_triangles)
      triangles.push_back({static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                           static_cast<std::uint32_t>(t[2])});
    MeshChunk narrow = chunk;
    narrow.triangles = triangles;
    narrow.wide_triangles = {};
    std::vector<Vec3f> positions, normals;
    if (indexing_ == Indexing::chunk_local) {
      for (Triangle& t : triangles)
        for (std::uint32_t& v : t) {
          positions.push_back(chunk.positions[v]);
          if (!chunk.normals.empty()) normals.push_back(chunk.normals[v]);
          v = static_cast<std::uint32_t>(mesh.positions.size() + positions.size() - 1);
        }
      narrow.positions = positions;
      narrow.normals = normals;
    }
    sink_.write(narrow);
  }
  void finish() override { sink_.finish(); }
  std::uint64_t bytes() const override { return 0; }

  Mesh mesh;
  bool is_wide = false;

 private:
  Indexing indexing_;
  MemorySink sink_{mesh};
};

std::vector<MeshFilterOptions> every_filter() {
  std::vector<MeshFilterOptions> all(8);
  all[0].measure = true;
  all[1].min_component = 50;
  all[2].largest = 20;
  all[3].smooth = 4;
  all[4].simplify_ratio = 0.2;
  all[5].max_error = 0.01;
  all[6] = {.largest = 20, .smooth = 2, .measure = true};
  all[6].simplify_triangles = 500;
  all[7].takes_welded = true;
  return all;
}

TEST(Wide, FiltersMakeTheSameMesh) {
  for (const auto& [normals, memory] : {std::pair(false, 1u << 24), std::pair(true, 1u << 18)}) {
    const Mesh mesh = debris(normals);
    for (const MeshFilterOptions& request : every_filter())
      for (const Indexing indexing : {Indexing::welded, Indexing::chunk_local}) {
        MeshFilterOptions options = request;
        options.memory = memory;
        EitherSink expected(indexing), found(indexing);
        MeshFilter narrow(expected, options), wide(found, options);
        write_chunks(mesh, narrow, 333);
        ASSERT_TRUE(wide.takes_wide());
        Widening widening(wide);
        write_chunks(mesh, widening, 333);
        EXPECT_TRUE(same(found.mesh, expected.mesh));
        EXPECT_EQ(wide.size().triangles, narrow.size().triangles);
        EXPECT_EQ(wide.size().vertices, narrow.size().vertices);
        EXPECT_EQ(wide.simplify_goal(), narrow.simplify_goal());
        ASSERT_EQ(wide.measure().has_value(), options.measure);
        if (options.measure) {
          EXPECT_EQ(wide.measure()->area, narrow.measure()->area);
          EXPECT_EQ(wide.measure()->volume, narrow.measure()->volume);
          EXPECT_EQ(wide.measure()->components, narrow.measure()->components);
          EXPECT_EQ(wide.measure()->euler_number, narrow.measure()->euler_number);
          EXPECT_EQ(wide.measure()->open_sides, narrow.measure()->open_sides);
          EXPECT_EQ(wide.measure()->vertices, narrow.measure()->vertices);
        }
        // What a filter left is small; what it only moved or measured is not.
        const bool reduces =
            options.simplifies() || options.min_component > 1 || options.largest > 0;
        EXPECT_EQ(found.is_wide, !reduces && indexing == Indexing::welded);
      }
  }
}

TEST(Wide, WhatIsReducedEnoughFitsAnySink) {
  const Mesh mesh = debris();
  for (const MeshFilterOptions& options : every_filter()) {
    Mesh result;
    MemorySink sink(result);
    const bool reduces = options.simplifies() || options.min_component > 1 || options.largest > 0;
    EXPECT_EQ(MeshFilter(sink, options).takes_wide(), reduces);
    if (!reduces) continue;
    MeshFilter filter(sink, options);
    Widening widening(filter);
    write_chunks(mesh, widening, 1000);
    EXPECT_TRUE(same(result, filtered(mesh, options).mesh));
  }
}

/// Writes a wide mesh through a stage with a lower limit.
template <class Stage, class Choice>
void pass(const Mesh& mesh, MeshSink& to, const Choice& choice, std::uint64_t max_narrow) {
  Stage stage(to, {}, {.page_bytes = 256}, 64 << 10, choice, max_narrow);
  Widening widening(stage);
  write_chunks(mesh, widening, 100);
}

TEST(Wide, WhatIsLeftStaysWideWhereItIsLarge) {
  const Mesh mesh = debris(true);
  const ComponentChoice largest{.largest = 20};
  const Simplification ratio{.ratio = 0.3}, none{.triangles = 1'000'000};
  using Component = ComponentStage<std::uint64_t>;
  using Simplify = SimplifyStage<std::uint64_t>;
  const auto check = [&](const auto& pass_to, const Mesh& expected) {
    const std::uint64_t vertices = expected.positions.size();
    for (const std::uint64_t limit : {vertices - 1, vertices}) {
      EitherSink sink;
      pass_to(sink, limit);
      EXPECT_EQ(sink.is_wide, limit < vertices);
      EXPECT_TRUE(same(sink.mesh, expected));
    }
    Mesh never;
    MemorySink narrow(never);
    try {
      pass_to(narrow, vertices - 1);
      ADD_FAILURE() << "a sink took too many vertices";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(std::to_string(vertices)), std::string::npos);
      EXPECT_TRUE(never.positions.empty());
    }
  };
  check([&](MeshSink& to, std::uint64_t limit) { pass<Component>(mesh, to, largest, limit); },
        filtered(mesh, {.largest = 20}).mesh);
  check([&](MeshSink& to, std::uint64_t limit) { pass<Simplify>(mesh, to, ratio, limit); },
        filtered(mesh, {.simplify_ratio = 0.3}).mesh);
  check([&](MeshSink& to, std::uint64_t limit) { pass<Simplify>(mesh, to, none, limit); }, mesh);
}

TEST(Wide, SetsHaveVerticesFarApart) {
  VertexSets<std::uint64_t> sets({}, 1 << 20);
  sets.grow(6'000'000'000);
  sets.connect({5'999'999'999, 4'300'000'000, 1});
  sets.connect({5'000'000'000, 2, 3});
  EXPECT_EQ(sets.used(), 6u);
  EXPECT_EQ(sets.sets(), 2u);
  EXPECT_EQ(sets.root(4'300'000'000), 1u);
  EXPECT_EQ(sets.root(5'000'000'000), 2u);
  sets.connect({4'300'000'000, 5'000'000'000, 1});
  EXPECT_EQ(sets.sets(), 1u);
  EXPECT_EQ(sets.root(2), 1u);
  EXPECT_EQ(sets.root(4), VertexSets<std::uint64_t>::kNone);
}

TEST(Wide, GroupsNumberVerticesFarApart) {
  const std::vector<WideTriangle> triangles{{8'000'000'000, 3, 4'294'967'299},
                                            {3, 8'000'000'000, 1}};
  const auto group = group_of<std::uint64_t>(triangles);
  EXPECT_EQ(group.numbers, (std::vector<std::uint64_t>{1, 3, 4'294'967'299, 8'000'000'000}));
  EXPECT_EQ(group.vertices, 4u);
  EXPECT_EQ(group.triangles, (std::vector<Triangle>{{3, 1, 2}, {1, 3, 0}}));
}

}  // namespace
}  // namespace isobrick::test

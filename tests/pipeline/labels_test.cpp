#include <isobrick/labels.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <utility>

#include <isobrick/error.h>
#include "tests/pipeline/labels_fixture.h"
#include "tests/pipeline/least_budget.h"
#include "tests/surface/mesh_topology.h"

namespace isobrick::test {
namespace {

using isobrick::testing::Field;
using isobrick::testing::Mesh;
using Meshes = std::map<Label, Mesh>;

template <class T>
Field<T> noise(Int3 extent, unsigned labels, unsigned seed) {
  std::mt19937 random(seed);
  return Field<T>(extent, [&](Int3) { return static_cast<double>(random() % labels); });
}

double enclosed_volume(const Mesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const auto at = [&](std::size_t i) {
      const Vec3f p = mesh.positions[t[i]];
      return Vec3d{p.x, p.y, p.z};
    };
    sum += dot(at(0), cross(at(1), at(2))) / 6;
  }
  return sum;
}

using Corner = std::array<float, 3>;
using Corners3 = std::array<Corner, 3>;

/// The corners of a triangle, the smallest first, in their order or the other way round.
Corners3 corners_of(const Mesh& mesh, const Triangle& t, bool is_reversed = false) {
  Corners3 corners;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3f p = mesh.positions[t[i]];
    corners[is_reversed ? 2 - i : i] = {p.x, p.y, p.z};
  }
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

TEST_F(Labels, MeshesAreClosedManifolds) {
  for (const Int3 extent : {Int3{20, 21, 22}, Int3{33, 32, 31}, Int3{65, 34, 40}})
    for (const unsigned labels : {2u, 3u, 20u}) {
      const StoreReader s = store(noise<std::uint8_t>(extent, labels, labels), 16);
      const Meshes meshes = meshes_of_all(s);
      EXPECT_EQ(meshes.size(), labels);
      for (const auto& [label, mesh] : meshes)
        EXPECT_TRUE(isobrick::testing::is_closed_manifold(mesh)) << label;
    }
}

/// Every triangle has its reverse in one other mesh, but at the volume's border.
void expect_common_walls(const Meshes& meshes, Int3 extent) {
  std::multiset<Corners3> forward, backward;
  for (const auto& [label, mesh] : meshes)
    for (const Triangle& t : mesh.triangles) {
      forward.insert(corners_of(mesh, t));
      backward.insert(corners_of(mesh, t, true));
    }
  std::size_t at_border = 0;
  for (const Corners3& corners : forward) {
    const bool is_outer = std::any_of(corners.begin(), corners.end(), [&](const Corner& c) {
      bool outer = false;
      for (int axis = 0; axis < 3; ++axis) {
        const float p = c[static_cast<std::size_t>(axis)];
        outer |= p < 0 || p > static_cast<float>(extent[axis] - 1);
      }
      return outer;
    });
    const std::size_t opposite = backward.count(corners);
    EXPECT_TRUE(opposite == 1 || is_outer);
    at_border += opposite == 0;
  }
  EXPECT_GT(at_border, 0u);
  EXPECT_LT(at_border, forward.size() / 2);
}

TEST_F(Labels, WallsCoincide) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({50, 45, 40}, 30, 1);
  const StoreReader s = store(field);
  for (const int smooth : {0, 1, 6}) {
    const Meshes meshes = meshes_of_all(s, {.smooth = smooth});
    ASSERT_EQ(meshes.count(0), 1u);
    expect_common_walls(meshes, field.extent);
    for (const auto& [label, mesh] : meshes)
      EXPECT_TRUE(isobrick::testing::is_closed_manifold(mesh)) << label;
  }
}

TEST_F(Labels, EnclosedVolumesAreThoseOfTheSamples) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({60, 60, 60}, 25, 2);
  std::map<Label, double> samples;
  for (const std::uint16_t label : field.samples) ++samples[label];
  double sum = 0;
  for (const auto& [label, mesh] : meshes_of_all(store(field))) {
    const double volume = enclosed_volume(mesh);
    sum += volume;
    EXPECT_NEAR(volume, samples[label], 0.05 * samples[label]) << label;
  }
  // Walls take nothing away; only the volume's own edges are rounded.
  EXPECT_NEAR(sum, 60 * 60 * 60, 0.01 * 60 * 60 * 60);
}

TEST_F(Labels, NeighboursAlongAnAxisBelongTogether) {
  Field<std::uint8_t> field(Int3{12, 12, 12});
  for (Index i = 2; i < 8; ++i) {
    field.at({i, i, 3}) = 1;
    field.at({i, i, i + 2}) = 2;
    field.at({i, 10, 3}) = 3;
  }
  const Meshes meshes = meshes_of(store(field));
  EXPECT_EQ(isobrick::testing::betti_of(meshes.at(1)).b0, 6);
  EXPECT_EQ(isobrick::testing::betti_of(meshes.at(2)).b0, 6);
  EXPECT_EQ(isobrick::testing::betti_of(meshes.at(3)).b0, 1);
}

/// The isosurface between a label and the rest, which is larger and so in one piece on faces.
Mesh isosurface_of(const Field<std::uint16_t>& field, const Label& label) {
  const Field<std::uint8_t> others(field.extent + Int3{2, 2, 2}, [&](Int3 p) {
    const Int3 q = p - Int3{1, 1, 1};
    return field.box().contains(q) && field.at(q) == label ? 0.0 : 1.0;
  });
  return isobrick::testing::extract(others, {.isovalue = 0.5, .inside = Inside::below});
}

TEST_F(Labels, TopologyIsThatOfTheIsosurfaceButForTunnelsWithoutWidth) {
  for (const auto& field :
       {cells<std::uint16_t>({40, 40, 40}, 12, 3), cells<std::uint16_t>({45, 40, 35}, 60, 12)}) {
    int closed = 0;
    for (const auto& [label, mesh] : meshes_of(store(field))) {
      const auto ours = isobrick::testing::betti_of(mesh);
      const auto surface = isobrick::testing::betti_of(isosurface_of(field, label));
      EXPECT_EQ(ours.b0, surface.b0) << label;
      EXPECT_LE(ours.b1, surface.b1) << label;
      closed += ours.b1 < surface.b1;
    }
    EXPECT_LE(closed, 2);
  }
}

TEST_F(Labels, NothingButVolumeLevelAndRegionShows) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({70, 66, 50}, 40, 4);
  const StoreReader s = store(field);
  LabelOptions options{.threads = 1};
  const Meshes expected = meshes_of(s, options);
  EXPECT_GT(expected.size(), 20u);
  EXPECT_EQ(expected.count(0), 0u);
  EXPECT_EQ(meshes_of(store(field, 16), {.threads = 3}), expected);
  EXPECT_EQ(meshes_of(store(field, 32), {.threads = 5}), expected);
  std::uint64_t least = 0;
  options.memory = 1;
  try {
    meshes_of(s, options);
    ADD_FAILURE() << "a budget of one byte was enough";
  } catch (const UsageError& e) {
    least = least_budget_in(e.what());
  }
  options.memory = least;
  EXPECT_EQ(meshes_of(s, options), expected);
  // The other labels do not matter.
  options = {.labels = {{7, 7}, {11, 13}}};
  const Meshes chosen = meshes_of(s, options);
  ASSERT_EQ(chosen.size(), 4u);
  for (const auto& [label, mesh] : chosen) EXPECT_EQ(mesh, expected.at(label)) << label;
}

TEST_F(Labels, TotalsAreKnownBeforeTheFirstMesh) {
  const StoreReader s = store(cells<std::uint16_t>({70, 66, 50}, 40, 4));
  LabelTotals totals;
  int calls = 0;
  LabelOptions options;
  options.check_totals = [&](const LabelTotals& all) { totals = all, ++calls; };
  LabelReport report;
  const Meshes meshes = meshes_of(s, options, &report);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(totals.labels, meshes.size());
  EXPECT_EQ(totals.size.vertices, report.vertices);
  EXPECT_EQ(totals.size.triangles, report.triangles);
  MeshSize largest;
  for (const auto& [label, mesh] : meshes) {
    largest.vertices = std::max<std::uint64_t>(largest.vertices, mesh.positions.size());
    largest.triangles = std::max<std::uint64_t>(largest.triangles, mesh.triangles.size());
  }
  EXPECT_EQ(totals.largest.vertices, largest.vertices);
  EXPECT_EQ(totals.largest.triangles, largest.triangles);
  // What it throws comes before any mesh.
  options.check_totals = [](const LabelTotals&) { throw Error("too many"); };
  const auto never = [](const LabelMesh&) { ADD_FAILURE() << "a mesh was passed on"; };
  EXPECT_THROW(extract_labels(s, options, never), Error);
}

TEST_F(Labels, SmoothMeshesDependOnNothingElseEither) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({70, 66, 50}, 40, 4);
  for (const int smooth : {1, 6}) {
    const Meshes expected = meshes_of(store(field), {.smooth = smooth, .threads = 1});
    EXPECT_EQ(meshes_of(store(field, 16), {.smooth = smooth, .threads = 3}), expected);
    const Meshes one = meshes_of(store(field, 32), {.labels = {{7, 7}}, .smooth = smooth});
    EXPECT_EQ(one.at(7), expected.at(7));
  }
}

TEST_F(Labels, BordersOfTilesDoNotShowInSmoothMeshes) {
  // The same objects, far from the border, with other tiles around them.
  const Field<std::uint8_t> all = cells<std::uint8_t>({60, 60, 60}, 20, 15);
  const auto objects = [&](Index shift) {
    const Box3 inner{{4, 4, 4}, {56, 56, 56}};
    return Field<std::uint8_t>(all.extent + Int3{shift, shift, shift}, [&](Int3 p) {
      const Int3 q = p - Int3{shift, shift, shift};
      return inner.contains(q) ? static_cast<double>(all.at(q)) : 0.0;
    });
  };
  const Meshes meshes = meshes_of(store(objects(0)), {.smooth = 6});
  const Meshes shifted = meshes_of(store(objects(13)), {.smooth = 6});
  ASSERT_EQ(meshes.size(), shifted.size());
  for (const auto& [label, mesh] : meshes) {
    constexpr float rounding = 3e-5f;
    std::vector<Corner> expected;
    for (const Vec3f& p : mesh.positions) expected.push_back({p.x, p.y, p.z});
    std::sort(expected.begin(), expected.end());
    std::size_t missing = 0;
    for (const Vec3f& p : shifted.at(label).positions) {
      const Vec3f q = p - Vec3f{13, 13, 13};
      auto near = std::lower_bound(expected.begin(), expected.end(), Corner{q.x - rounding, 0, 0});
      while (near != expected.end() && (*near)[0] <= q.x + rounding &&
             (std::abs((*near)[1] - q.y) > rounding || std::abs((*near)[2] - q.z) > rounding))
        ++near;
      missing += near == expected.end() || (*near)[0] > q.x + rounding;
    }
    EXPECT_EQ(missing, 0u) << label;
  }
}

TEST_F(Labels, SmoothingMovesPointsWithinTheirCells) {
  const Int3 extent{70, 70, 70};
  const Field<std::uint8_t> ball(extent, [](Int3 p) {
    const Int3 d = p - Int3{35, 35, 35};
    return dot(d, d) < 30 * 30 ? 1.0 : 0.0;
  });
  const StoreReader s = store(ball);
  const Mesh rough = meshes_of(s).at(1);
  const auto farthest = [](const Mesh& mesh) {
    float most = 0;
    for (const Vec3f& p : mesh.positions) {
      const Vec3f d = p - Vec3f{35, 35, 35};
      most = std::max(most, std::abs(std::sqrt(dot(d, d)) - 30));
    }
    return most;
  };
  const Mesh smooth = meshes_of(s, {.smooth = 6}).at(1);
  EXPECT_EQ(smooth.triangles.size(), rough.triangles.size());
  EXPECT_LT(farthest(smooth), farthest(rough));
  EXPECT_NEAR(enclosed_volume(smooth), enclosed_volume(rough), 0.01 * enclosed_volume(rough));
  for (std::size_t i = 0; i < rough.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_EQ(std::floor(rough.positions[i][axis]),
                std::min(std::floor(smooth.positions[i][axis]),
                         std::ceil(smooth.positions[i][axis]) - 1));
}

TEST_F(Labels, ChosenLabelsTouchTheirBricksOnly) {
  Field<std::uint8_t> field(Int3{128, 128, 128});
  for_each_point({{2, 2, 2}, {20, 20, 20}}, [&](Int3 p) { field.at(p) = 5; });
  for_each_point({{80, 80, 80}, {120, 120, 120}}, [&](Int3 p) { field.at(p) = 9; });
  const StoreReader s = store(field, 16);
  LabelReport all, one;
  meshes_of(s, {}, &all);
  meshes_of(s, {.labels = {{9, 9}}}, &one);
  EXPECT_EQ(all.bricks_read, 8u + 27u);
  EXPECT_EQ(one.bricks_read, 27u);
}

TEST_F(Labels, ARegionIsAVolumeOfItsOwn) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({70, 50, 50}, 20, 5);
  const Box3 roi{{31, 3, 16}, {64, 40, 49}};
  const Field<std::uint16_t> part(
      roi.extent(), [&](Int3 p) { return static_cast<double>(field.at(p + roi.lo)); });
  Meshes expected = meshes_of(store(part));
  const Meshes meshes = meshes_of(store(field), {.roi = roi});
  ASSERT_EQ(meshes.size(), expected.size());
  for (auto& [label, mesh] : expected) {
    for (Vec3f& p : mesh.positions)
      p = p + Vec3f{static_cast<float>(roi.lo.x), static_cast<float>(roi.lo.y),
                    static_cast<float>(roi.lo.z)};
    EXPECT_EQ(meshes.at(label).positions.size(), mesh.positions.size()) << label;
    EXPECT_EQ(meshes.at(label).triangles.size(), mesh.triangles.size()) << label;
    EXPECT_NEAR(enclosed_volume(meshes.at(label)), enclosed_volume(mesh), 0.1) << label;
    EXPECT_TRUE(isobrick::testing::is_closed_manifold(meshes.at(label))) << label;
  }
}

TEST_F(Labels, EverySampleTypeGivesTheSameMeshes) {
  const Int3 extent{40, 35, 34};
  const Meshes expected = meshes_of(store(cells<std::uint8_t>(extent, 20, 6)));
  EXPECT_EQ(meshes_of(store(cells<std::int8_t>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<std::int16_t>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<std::uint16_t>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<std::int32_t>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<std::uint32_t>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<float>(extent, 20, 6))), expected);
  EXPECT_EQ(meshes_of(store(cells<double>(extent, 20, 6))), expected);
}

TEST_F(Labels, ArraysAndFunctionsGiveTheMeshesOfAStore) {
  const Field<std::uint16_t> field = cells<std::uint16_t>({70, 45, 40}, 20, 14);
  const Meshes expected = meshes_of(store(field), {.smooth = 2});
  Volume array = Volume::of(field.samples.data(), field.extent);
  EXPECT_EQ(meshes_of(array, {.smooth = 2, .threads = 2}), expected);
  Volume function{.type = ScalarType::u16, .extent = field.extent};
  function.read = [&](Box3 box, void* out) {
    auto* samples = static_cast<std::uint16_t*>(out);
    for_each_point(box, [&](Int3 p) { *samples++ = field.at(p); });
  };
  EXPECT_EQ(meshes_of(function, {.smooth = 2}), expected);
  function.concurrent_reads = true;
  EXPECT_EQ(meshes_of(function, {.smooth = 2, .threads = 3}), expected);
  // The samples from the last to the first are the volume in the mirror.
  array.samples = &field.samples.back();
  array.strides = {-2, -2 * field.extent.x, -2 * field.extent.x * field.extent.y};
  const Meshes mirrored = meshes_of(array);
  ASSERT_EQ(mirrored.size(), expected.size());
  for (const auto& [label, mesh] : mirrored) {
    EXPECT_EQ(mesh.triangles.size(), expected.at(label).triangles.size());
    EXPECT_GT(enclosed_volume(mesh), 0);
  }
  array.nodata = 7;
  EXPECT_EQ(meshes_of(array).count(7), 0u);
  EXPECT_THROW(meshes_of(array, {.level = 1}), UsageError);
}

TEST_F(Labels, SinksOfUnweldedChunksGetTheSameTriangles) {
  const StoreReader s = store(cells<std::uint8_t>({50, 40, 40}, 8, 13));
  extract_labels(s, {.threads = 1}, [](const LabelMesh& label) {
    isobrick::Mesh mesh;
    MemorySink sink(mesh);
    label.write(sink);
    std::size_t next = 0;
    FunctionSink unwelded(
        [&](const MeshChunk& chunk) {
          for (const Triangle& t : chunk.triangles) {
            for (std::size_t i = 0; i < 3; ++i)
              EXPECT_EQ(chunk.positions[t[i]], mesh.positions[mesh.triangles[next][i]]);
            ++next;
          }
        },
        Indexing::chunk_local);
    label.write(unwelded);
    EXPECT_EQ(next, mesh.triangles.size());
  });
}

TEST_F(Labels, LargeAndNegativeLabels) {
  Field<double> field(Int3{10, 10, 10});
  field.at({3, 3, 3}) = -1;
  field.at({5, 5, 5}) = 9007199254740992;  // 2^53
  field.at({7, 7, 7}) = std::nan("");
  const Meshes meshes = meshes_of(store(field));
  ASSERT_EQ(meshes.size(), 2u);
  EXPECT_EQ(meshes.at(-1).positions.size(), 8u);
  EXPECT_EQ(meshes.at(9007199254740992).triangles.size(), 12u);
}

TEST_F(Labels, VolumesThatAreThin) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{33, 1, 1}, Int3{1, 40, 20}, Int3{64, 64, 1}}) {
    const Meshes meshes = meshes_of(store(Field<std::uint8_t>(extent, [](Int3) { return 3.0; })));
    ASSERT_EQ(meshes.size(), 1u);
    EXPECT_TRUE(isobrick::testing::is_closed_manifold(meshes.at(3)));
    EXPECT_GT(enclosed_volume(meshes.at(3)), 0);
  }
  EXPECT_TRUE(meshes_of(store(Field<std::uint8_t>(Int3{20, 20, 20}))).empty());
}

TEST_F(Labels, LeftHandedAxesKeepTheOutsideOutside) {
  Transform mirrored;
  mirrored.direction = {-1, 0, 0, 0, 1, 0, 0, 0, 1};
  mirrored.spacing = {0.5, 1, 2};
  const Field<std::uint8_t> field = cells<std::uint8_t>({40, 40, 40}, 5, 7);
  for (const auto& [label, mesh] : meshes_of(store(field, 64, mirrored)))
    EXPECT_GT(enclosed_volume(mesh), 0) << label;
}

TEST_F(Labels, CoarseLevelsHaveTheirOwnMeshes) {
  const StoreReader s = store(cells<std::uint16_t>({64, 64, 64}, 10, 8), 16);
  const Meshes fine = meshes_of(s), coarse = meshes_of(s, {.level = 1});
  EXPECT_EQ(fine.size(), coarse.size());
  for (const auto& [label, mesh] : coarse) {
    EXPECT_TRUE(isobrick::testing::is_closed_manifold(mesh));
    EXPECT_NEAR(enclosed_volume(mesh), enclosed_volume(fine.at(label)),
                0.1 * enclosed_volume(fine.at(label)));
  }
}

TEST_F(Labels, RefusesWhatMakesNoSense) {
  const StoreReader s = store(cells<std::uint8_t>({20, 20, 20}, 5, 9));
  EXPECT_THROW(meshes_of(s, {.labels = {{77, 77}}}), UsageError);
  EXPECT_NO_THROW(meshes_of(s, {.labels = {{70, 80}}}));
  EXPECT_THROW(meshes_of(s, {.labels = {{5, 4}}}), UsageError);
  EXPECT_THROW(meshes_of(s, {.smooth = 7}), UsageError);
  EXPECT_THROW(meshes_of(s, {.smooth = 1, .pass_band = 0}), UsageError);
  EXPECT_THROW(meshes_of(s, {.level = 9}), UsageError);
  EXPECT_THROW(meshes_of(s, {.roi = Box3{{0, 0, 0}, {21, 5, 5}}}), UsageError);
  Field<float> field(Int3{10, 10, 10});
  field.at({4, 4, 4}) = 2.5f;
  const StoreReader halves = store(field);
  EXPECT_THROW(meshes_of(halves), Error);
}

TEST_F(Labels, WhatAVisitorThrowsEndsIt) {
  const StoreReader s = store(cells<std::uint8_t>({40, 40, 40}, 30, 10));
  EXPECT_THROW(extract_labels(s, {}, [](const LabelMesh&) { throw Error("the disk is full"); }),
               Error);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(extract_labels(s, {.cancel = stop.get_token()}, [](const LabelMesh&) {}), Cancelled);
}

}  // namespace
}  // namespace isobrick::test

#include <isobrick/mesh_filters.h>

#include <gtest/gtest.h>

#include <isobrick/progress.h>
#include "core/vectors.h"
#include "filters/smooth_stage.h"
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

/// The gyroid, cut by a ball so that it is closed; `noise` moves samples.
Mesh gyroid(double noise) {
  std::uint32_t state = 1;
  return surface_of(64, -7, 7, [&](double x, double y, double z) {
    state = state * 1664525 + 1013904223;
    const double shift = noise * (state / 4294967296.0 - 0.5);
    const double g =
        std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) + std::sin(z) * std::cos(x);
    return std::min(g, 6.5 - std::hypot(x, y, z)) + shift;
  });
}

/// The mean angle between the normals of triangles that share a side, in radians: roughness.
double mean_bend(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, Vec3d> normals;
  const auto at = [&](std::uint32_t v) { return to_double(mesh.positions[v]); };
  double sum = 0;
  int count = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d normal = unit(cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0])), {0, 0, 1});
    for (std::size_t i = 0; i < 3; ++i) {
      normals[{t[i], t[(i + 1) % 3]}] = normal;
      if (const auto other = normals.find({t[(i + 1) % 3], t[i]}); other != normals.end()) {
        sum += std::acos(std::clamp(dot(normal, other->second), -1.0, 1.0));
        ++count;
      }
    }
  }
  return sum / count;
}

TEST(Smooth, KeepsTheVolumeOfASphere) {
  const Mesh mesh = sphere(40);
  const double before = measure(mesh).volume.value();
  for (const int iterations : {1, 10, 30}) {
    const Mesh smooth = filtered(mesh, {.smooth = iterations}).mesh;
    EXPECT_NEAR(measure(smooth).volume.value(), before, 0.01 * before) << iterations;
    EXPECT_TRUE(std::ranges::equal(smooth.triangles.span(), mesh.triangles.span()));
  }
}

TEST(Smooth, KeepsTheVolumeOfAGyroidAndItsTopology) {
  const Mesh mesh = gyroid(0);
  const MeshMeasure before = measure(mesh),
                    after = *filtered(mesh, {.smooth = 20, .measure = true}).measure;
  ASSERT_TRUE(before.is_closed());
  EXPECT_NEAR(*after.volume, *before.volume, 0.01 * *before.volume);
  EXPECT_EQ(after.euler_number, before.euler_number);
  EXPECT_TRUE(after.is_closed());
}

TEST(Smooth, TakesNoiseAway) {
  const Mesh rough = gyroid(0.3);
  const double bend = mean_bend(rough);
  EXPECT_LT(mean_bend(filtered(rough, {.smooth = 20}).mesh), 0.5 * bend);
  // A wider pass band leaves more of it.
  EXPECT_GT(mean_bend(filtered(rough, {.smooth = 20, .pass_band = 0.6}).mesh),
            mean_bend(filtered(rough, {.smooth = 20}).mesh));
}

/// One iteration as the paper has it, from lists of neighbours.
std::vector<Vec3d> taubin_once(const Mesh& mesh, double pass_band) {
  std::vector<Vec3d> p;
  for (const Vec3f& v : mesh.positions) p.push_back(to_double(v));
  std::vector<std::map<std::uint32_t, int>> neighbours(p.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) neighbours[t[i]][t[(i + 1) % 3]] = 1;
  for (const double fraction : {0.6307, 1 / (pass_band - 1 / 0.6307)}) {
    std::vector<Vec3d> next = p;
    for (std::size_t v = 0; v < p.size(); ++v) {
      Vec3d mean;
      for (const auto& [other, one] : neighbours[v]) mean = mean + p[other];
      mean = mean * (1 / static_cast<double>(neighbours[v].size()));
      next[v] = p[v] + (mean - p[v]) * fraction;
    }
    p = next;
  }
  return p;
}

TEST(Smooth, IsTaubinsStepOnAClosedMesh) {
  const Mesh mesh = sphere(20);
  for (const double pass_band : {0.1, 0.4}) {
    const Mesh smooth = filtered(mesh, {.smooth = 1, .pass_band = pass_band}).mesh;
    const std::vector<Vec3d> expected = taubin_once(mesh, pass_band);
    for (std::size_t v = 0; v < expected.size(); ++v)
      ASSERT_LT(length(to_double(smooth.positions[v]) - expected[v]), 1e-6);
  }
}

TEST(Smooth, LeavesOpenBordersWhereTheyAre) {
  const Mesh mesh = debris();
  const Mesh smooth = filtered(mesh, {.smooth = 10}).mesh;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) sides[{t[i], t[(i + 1) % 3]}] = 1;
  std::size_t moved = 0, fixed = 0;
  std::vector<bool> is_border(mesh.positions.size());
  for (const auto& [side, one] : sides)
    if (!sides.contains({side.second, side.first}))
      is_border[side.first] = is_border[side.second] = true;
  for (std::size_t v = 0; v < is_border.size(); ++v) {
    const bool same_place = smooth.positions[v] == mesh.positions[v];
    if (is_border[v]) {
      EXPECT_TRUE(same_place);
      ++fixed;
    } else {
      moved += !same_place;
    }
  }
  EXPECT_GT(fixed, 100u);
  EXPECT_GT(moved, is_border.size() / 2);
}

TEST(Smooth, MakesNormalsOfTheTriangles) {
  const Mesh mesh = sphere(40, 1, true);
  const Mesh smooth = filtered(mesh, {.smooth = 5}).mesh;
  ASSERT_EQ(smooth.normals.size(), smooth.positions.size());
  for (std::size_t v = 0; v < smooth.normals.size(); ++v) {
    const Vec3d n = to_double(smooth.normals[v]);
    EXPECT_NEAR(length(n), 1, 1e-6);
    EXPECT_GT(dot(n, unit(to_double(smooth.positions[v]), {})), 0.98) << "not outward";
  }
}

TEST(Smooth, DependsOnNeitherChunksNorMemory) {
  const Mesh mesh = debris(true);
  const Mesh expected = filtered(mesh, {.smooth = 4}).mesh;
  for (const std::uint64_t memory : {0u, 1u << 20})
    for (const std::size_t chunk : {9u, 1234u})
      EXPECT_TRUE(same(filtered(mesh, {.smooth = 4, .memory = memory}, chunk).mesh, expected));
}

TEST(Smooth, NeedsFewPages) {
  const Mesh mesh = sphere(24, 1, true);
  const Mesh expected = filtered(mesh, {.smooth = 3}).mesh;
  Mesh result;
  MemorySink sink(result);
  SmoothStage<std::uint32_t> stage(sink, {}, {.page_bytes = 256}, 16 << 10, {.iterations = 3});
  EXPECT_LE(stage.memory(), 16u << 10);
  write_chunks(mesh, stage, 50);
  EXPECT_TRUE(same(result, expected));
}

TEST(Smooth, ReportsItsIterations) {
  struct Counts final : Progress {
    void begin(std::string_view stage, std::uint64_t total) override {
      EXPECT_EQ(stage, "smoothing");
      left = total;
    }
    void advance(std::uint64_t done) override { left -= done; }
    void end() override { ended = true; }
    std::uint64_t left = 0;
    bool ended = false;
  } counts;
  (void)filtered(sphere(20), {.smooth = 7, .progress = &counts});
  EXPECT_EQ(counts.left, 0u);
  EXPECT_TRUE(counts.ended);
}

TEST(Smooth, OfAnEmptyMeshAndALoneVertex) {
  EXPECT_TRUE(filtered(Mesh(), {.smooth = 3}).mesh.positions.empty());
  Mesh lone;
  lone.positions.resize(1);
  lone.positions[0] = {1, 2, 3};
  Mesh result;
  MemorySink sink(result);
  MeshFilter filter(sink, {.smooth = 3});
  filter.begin({});
  filter.write(lone.chunk());
  filter.finish();
  EXPECT_TRUE(same(result, lone));
}

}  // namespace
}  // namespace isobrick::test

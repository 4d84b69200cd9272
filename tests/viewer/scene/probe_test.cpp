#include "viewer/scene/probe.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/random_cut.h"
#include "viewer/scene/device_mesher.h"
#include "viewer/scene/isovalue_counts.h"
#include "viewer/scene/scene.h"

namespace isobrick::test {
namespace {

constexpr Index kEdge = 120;

std::shared_ptr<MemoryBricks> turned_ball() {
  MemoryBricks::Options options;
  options.transform.spacing = {0.5, 0.5, 0.5};
  options.transform.origin = {100, -50, 30};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  return std::make_shared<MemoryBricks>(
      Int3{kEdge, kEdge, kEdge},
      std::function<float(Int3)>([](Int3 p) { return static_cast<float>(ball(p, kEdge)); }),
      options);
}

TEST(Probe, TellsTheFieldOfTheFinestLevelThatIsThere) {
  const auto source = turned_ball();
  const NodeGrid grid(source->info());
  ResidentBricks bricks(source, 100 << 20);
  const Transform& t = grid.transform();
  const Vec3d world = t.apply({40.25, 71.5, 60});
  EXPECT_FALSE(probe(grid, bricks, world)) << "nothing is decoded";
  const auto decode = [&](int stored) {
    const Lattice& lattice = source->info().levels[static_cast<std::size_t>(stored)].lattice;
    for_each_point({{0, 0, 0}, lattice.bricks()},
                   [&](Int3 b) { (void)bricks.get(stored, b, Always()); });
  };
  decode(2);
  const auto coarse = probe(grid, bricks, world);
  ASSERT_TRUE(coarse);
  const double exact = 0.4 * kEdge - std::sqrt(19.25 * 19.25 + 12.0 * 12.0 + 0.5 * 0.5);
  EXPECT_NEAR(coarse->value, exact, 0.5);
  EXPECT_EQ(coarse->stored, 2);
  decode(0);
  const auto now = probe(grid, bricks, world);
  ASSERT_TRUE(now);
  EXPECT_EQ(now->stored, 0);
  EXPECT_NEAR(now->value, exact, 0.02);
  const Vec3d out = world - t.apply({59.5, 59.5, 59.5});
  const double length = std::sqrt(out.x * out.x + out.y * out.y + out.z * out.z);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(now->normal[axis], out[axis] / length, 0.01);
  EXPECT_FALSE(probe(grid, bricks, t.apply({-1, 5, 5}))) << "outside";
  // At the border only half a step is inside.
  const Vec3d border = t.apply({0, 59.5, 90});
  const Vec3d from_centre = border - t.apply({59.5, 59.5, 59.5});
  const double far = std::sqrt(dot(from_centre, from_centre));
  const auto at_border = probe(grid, bricks, border);
  ASSERT_TRUE(at_border);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(at_border->normal[axis], from_centre[axis] / far, 0.02);
  EXPECT_EQ(probe(grid, bricks, t.apply({3, 4, 5}))->value, source->value(0, {3, 4, 5}));
}

TEST(IsovalueCounts, BricksAreExactAndBlocksNearlySo) {
  const Index n = 100;
  const auto check = [&](const MemoryBricks& source, std::initializer_list<double> isovalues,
                         double tolerance) {
    const IsovalueCounts counts(source);
    const Lattice& lattice = source.info().levels[0].lattice;
    const RangeTable bricks = source.brick_ranges(0, {{0, 0, 0}, lattice.bricks()});
    const RangeTable blocks = source.block_ranges(0, {{0, 0, 0}, lattice.blocks()});
    for (const double isovalue : isovalues) {
      const auto active = [&](const RangeTable& table) {
        return std::count_if(table.ranges.begin(), table.ranges.end(),
                             [&](const auto& r) { return r.stabbed_by(isovalue); });
      };
      EXPECT_EQ(counts.active_bricks(isovalue), static_cast<std::uint64_t>(active(bricks)));
      EXPECT_NEAR(static_cast<double>(counts.active_blocks(isovalue)),
                  static_cast<double>(active(blocks)), tolerance);
    }
    EXPECT_EQ(counts.bricks(), static_cast<std::uint64_t>(volume(lattice.bricks())));
    EXPECT_EQ(counts.blocks(), static_cast<std::uint64_t>(volume(lattice.blocks())));
  };
  const MemoryBricks smooth(
      {n, n, n},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(blobs(p, n)); }), {});
  check(smooth, {-100.0, -40.0, -3.0, 0.0, 0.5, 2.0, 7.9, 8.1, 100.0}, 6);
  const MemoryBricks whole(
      {n, n, n}, std::function<std::uint8_t(Int3)>([&](Int3 p) {
        return static_cast<std::uint8_t>(std::clamp(128 + 10 * blobs(p, n), 0.0, 255.0));
      }),
      {});
  check(whole, {-1.0, 0.0, 0.5, 1.0, 90.0, 127.5, 128.0, 180.0, 254.5, 255.0, 256.0}, 0);
}

TEST(SliceSamples, HasTheSamplesOfThePlane) {
  const auto source = turned_ball();
  ResidentBricks bricks(source, 100 << 20);
  for (int axis = 0; axis < 3; ++axis) {
    const SliceSamples image = read_slice(bricks, {.axis = axis, .position = 33.2}, Always());
    EXPECT_EQ(image.stored, 0);
    EXPECT_EQ(image.type, ScalarType::f32);
    ASSERT_EQ(image.width, kEdge);
    ASSERT_EQ(image.height, kEdge);
    const auto* pixels = reinterpret_cast<const float*>(image.pixels.data());
    const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    for (Index j = 0; j < kEdge; j += 7)
      for (Index i = 0; i < kEdge; i += 5) {
        Int3 p;
        p[axis] = 33;
        p[u] = i;
        p[v] = j;
        EXPECT_EQ(pixels[j * kEdge + i], source->value(0, p));
      }
    Vec3d last{};
    last[axis] = 33;
    last[u] = last[v] = kEdge - 0.5;
    const Vec3d corner = source->info().levels[0].transform.apply(last);
    const Vec3d end = image.corner + image.along_width + image.along_height;
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(end[i], corner[i], 1e-9);
  }
  const SliceSamples small =
      read_slice(bricks, {.axis = 1, .position = 60, .bytes = 5000}, Always());
  EXPECT_GT(small.stored, 0);
  EXPECT_LE(small.pixels.size(), 5000u);
}

TEST(SliceSamples, ComesFromTheStreamAndSurvivesDamage) {
  const auto source = turned_ball();
  source->damage(0, {1, 1, 1});
  const auto tree = std::make_shared<const NodeTree>(*source);
  SceneStream stream(source, tree, {.threads = 2});
  EXPECT_EQ(stream.slice(0), nullptr);
  stream.set_slice(0, SliceRequest{.axis = 2, .position = 10});
  stream.set_slice(1, SliceRequest{.axis = 2, .position = 40});
  ASSERT_TRUE(stream.wait_idle(60));
  ASSERT_TRUE(stream.slice(0));
  EXPECT_TRUE(stream.slice(0)->damage.empty());
  ASSERT_TRUE(stream.slice(1));
  EXPECT_FALSE(stream.slice(1)->damage.empty());
  EXPECT_EQ(stream.slice(1)->width, kEdge);
  source->set_delay(std::chrono::milliseconds(5));
  for (int i = 0; i < 20; ++i) stream.set_slice(0, SliceRequest{.axis = 0, .position = 5.0 * i});
  ASSERT_TRUE(stream.wait_idle(60));
  EXPECT_EQ(stream.slice(0)->request.position, 95);
  stream.set_slice(0, {});
  EXPECT_EQ(stream.slice(0), nullptr);
}

}  // namespace
}  // namespace isobrick::test

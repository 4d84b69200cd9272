#include "viewer/scene/surface_box.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/forwarding_source.h"

namespace isobrick::test {
namespace {

std::shared_ptr<const MemoryBricks> bricks(Int3 extent, std::function<std::uint8_t(Int3)> f) {
  return std::make_shared<const MemoryBricks>(extent, std::move(f), MemoryBricks::Options{});
}

constexpr Vec3d kMiddle{100, 60, 45};
constexpr double kRadius = 20;

/// A field that is 128 on a sphere.
std::uint8_t ball(Int3 p, Vec3d middle, double radius) {
  const Vec3d d{static_cast<double>(p.x) - middle.x, static_cast<double>(p.y) - middle.y,
                static_cast<double>(p.z) - middle.z};
  return static_cast<std::uint8_t>(std::clamp(128 + 5 * (radius - std::sqrt(dot(d, d))), 0., 255.));
}
std::uint8_t small_ball(Int3 p) { return ball(p, kMiddle, kRadius); }

IndexBox whole(const BrickSource& source) {
  const Int3 last = source.info().levels.front().lattice.extent - Int3{1, 1, 1};
  return {{0, 0, 0},
          {static_cast<double>(last.x), static_cast<double>(last.y), static_cast<double>(last.z)}};
}

TEST(SurfaceBox, IsLessThanABlockLargerThanTheSurface) {
  const Vec3d middle{200, 100, 103};
  constexpr double radius = 85;
  const auto source = bricks({400, 200, 200}, [&](Int3 p) { return ball(p, middle, radius); });
  const NodeTree tree(*source);
  const auto box = surface_box(*source, tree, std::vector<double>{128}, whole(*source));
  ASSERT_TRUE(box);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LE(box->lo[axis], middle[axis] - radius) << axis;
    EXPECT_GT(box->lo[axis], middle[axis] - radius - kBlockEdge) << axis;
    EXPECT_EQ(std::fmod(box->lo[axis], kBlockEdge), 0) << axis;
    EXPECT_GE(box->hi[axis], middle[axis] + radius) << axis;
    EXPECT_LT(box->hi[axis], middle[axis] + radius + kBlockEdge) << axis;
  }
}

TEST(SurfaceBox, OfFewBlocksIsLessThanACellLarger) {
  const auto source = bricks({120, 90, 75}, small_ball);
  const NodeTree tree(*source);
  const auto box = surface_box(*source, tree, std::vector<double>{128, 100}, whole(*source));
  ASSERT_TRUE(box);
  // The isosurface of 100 is 5.6 samples farther out.
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(box->lo[axis], kMiddle[axis] - kRadius - 5.6, 1) << axis;
  }
  EXPECT_EQ(box->hi.x, 119) << "it ends with the volume";
  EXPECT_NEAR(box->hi.y, kMiddle.y + kRadius + 5.6, 1);
  EXPECT_NEAR(box->hi.z, kMiddle.z + kRadius + 5.6, 1);
}

TEST(SurfaceBox, HasNoSurfaceAroundNaN) {
  const MemoryBricks source({60, 60, 60}, std::function<float(Int3)>([](Int3 p) {
                              if (p.x > 40) return std::numeric_limits<float>::quiet_NaN();
                              return p.x < 30 ? 0.f : 1.f;
                            }),
                            MemoryBricks::Options{});
  const NodeTree tree(source);
  const auto plane = surface_box(source, tree, std::vector<double>{0.5}, whole(source));
  ASSERT_TRUE(plane);
  EXPECT_EQ(plane->lo, (Vec3d{29, 0, 0}));
  EXPECT_EQ(plane->hi, (Vec3d{30, 59, 59}));
}

TEST(SurfaceBox, IsOfThePartThatIsShown) {
  const auto source = bricks({200, 150, 130}, small_ball);
  const NodeTree tree(*source);
  const std::vector<double> isovalue{128};
  IndexBox part = whole(*source);
  part.lo.x = 110;
  part.hi.z = 50;
  const auto box = surface_box(*source, tree, isovalue, part);
  ASSERT_TRUE(box);
  EXPECT_EQ(box->lo.x, 110);
  EXPECT_EQ(box->hi.z, 50);
  EXPECT_LT(box->lo.y, 60);
  part.lo.x = 150;
  EXPECT_FALSE(surface_box(*source, tree, isovalue, part));
}

TEST(SurfaceBox, IsThatOfAllIsovaluesOrNone) {
  const auto source = bricks({200, 150, 130}, small_ball);
  const NodeTree tree(*source);
  EXPECT_FALSE(surface_box(*source, tree, std::vector<double>{}, whole(*source)));
  EXPECT_FALSE(surface_box(*source, tree, std::vector<double>{250}, whole(*source)));
  EXPECT_FALSE(surface_box(*source, tree, std::vector<double>{0}, whole(*source)));
  const auto inner = surface_box(*source, tree, std::vector<double>{220}, whole(*source));
  const auto both = surface_box(*source, tree, std::vector<double>{220, 30}, whole(*source));
  ASSERT_TRUE(inner && both);
  EXPECT_LT(both->lo.x, inner->lo.x);
  EXPECT_EQ(both, surface_box(*source, tree, std::vector<double>{30}, whole(*source)));
}

/// Counts the block ranges that are read.
class CountingSource final : public ForwardingSource {
 public:
  using ForwardingSource::ForwardingSource;
  bool read_brick(int level, Int3 brick, std::byte* out) const override {
    return from_->read_brick(level, brick, out);
  }
  RangeTable block_ranges(int level, Box3 box) const override {
    ++tables;
    most = std::max(most.load(), volume(box.extent()));
    return from_->block_ranges(level, box);
  }
  mutable std::atomic<int> tables = 0;
  mutable std::atomic<Index> most = 0;
};

TEST(SurfaceBox, ReadsOnlyWhatMayBeAtItsEnds) {
  // Active everywhere, over five range chunks.
  const CountingSource source(
      bricks({2500, 64, 40}, [](Int3 p) { return static_cast<std::uint8_t>(p.x % 2 * 200); }));
  const NodeTree tree(source);
  source.tables = 0;
  source.most = 0;
  const auto box = surface_box(source, tree, std::vector<double>{100}, whole(source));
  ASSERT_TRUE(box);
  EXPECT_EQ(box->lo, (Vec3d{0, 0, 0}));
  EXPECT_EQ(box->hi, (Vec3d{2499, 63, 39}));
  EXPECT_LE(source.tables, 2) << "of five chunks";
  EXPECT_LE(source.most, Index{32} * 4 * 3);
}

}  // namespace
}  // namespace isobrick::test

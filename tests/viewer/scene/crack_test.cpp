#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/active_of.h"
#include "tests/viewer/scene/random_cut.h"
#include "tests/viewer/scene/rasteriser.h"
#include "viewer/scene/node_mesher.h"

namespace isobrick::test {
namespace {

struct Shape {
  const char* name;
  std::function<double(Int3, Index)> field;
  int levels = 0;                  ///< stored levels; 0: until one brick holds the coarsest
  std::vector<Int3> factors = {};  ///< of the pyramid; none: all axes are halved
};

/// Pyramids of a volume with distant planes, and of one whose axes are halved alternately.
const std::vector<Int3> kFlat{{2, 2, 1}, {2, 2, 1}, {2, 2, 2}};
const std::vector<Int3> kTurns{{1, 2, 1}, {2, 1, 1}, {1, 1, 2}, {2, 2, 2}};

constexpr Index kEdge = 150;
constexpr int kPicture = 500;
constexpr int kViews = 3;

Rasteriser picture(int view) {
  return {kPicture, {74.5, 74.5, 74.5}, 68, static_cast<unsigned>(view)};
}

class Cracks : public ::testing::TestWithParam<Shape> {
 protected:
  Cracks()
      : source_(std::make_shared<MemoryBricks>(
            Int3{kEdge, kEdge, kEdge}, std::function<float(Int3)>([](Int3 p) {
              return static_cast<float>(GetParam().field(p, kEdge));
            }),
            MemoryBricks::Options{
                .brick = 16, .levels = GetParam().levels, .factors = GetParam().factors})),
        tree_(*source_),
        grid_(tree_.grid()),
        bricks_(source_, std::uint64_t{1} << 30),
        mesher_(grid_, bricks_, {}) {}

  std::vector<NodeMesh> meshes_of(const Cut& cut) {
    std::vector<NodeMesh> meshes;
    for (const CutNode& node : cut.nodes)
      meshes.push_back(mesher_.mesh(node.key, 0, node.coarser, Always()));
    return meshes;
  }

  std::shared_ptr<MemoryBricks> source_;
  NodeTree tree_;
  const NodeGrid& grid_;
  ResidentBricks bricks_;
  NodeMesher mesher_;
};

/// Along each ray through a closed surface as many sheets face the eye as face away, and the first
/// one faces it: for any cut and any direction of view.
TEST_P(Cracks, AreNotBetweenLevels) {
  std::size_t covered = 0, unbalanced = 0, inside_seen = 0, seam_strips = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const std::vector<NodeMesh> meshes =
        meshes_of(RandomCut(grid_, seed, 2 + static_cast<int>(seed) * 2).cut({0}));
    for (const NodeMesh& mesh : meshes) seam_strips += mesh.seam_triangles;
    for (int view = 0; view < kViews; ++view) {
      Rasteriser raster = picture(view + static_cast<int>(seed) * 100);
      for (const NodeMesh& mesh : meshes) raster.draw(mesh);
      for (const Rasteriser::Pixel& pixel : raster.pixels()) {
        covered += pixel.front > 0;
        unbalanced += pixel.front != pixel.back;
        inside_seen += pixel.nearest_is_back;
      }
    }
  }
  EXPECT_GT(covered, 500000u);
  EXPECT_GT(seam_strips, 1000u) << "there are borders between levels";
  // A vertex lies on its chord to within the rounding of float.
  EXPECT_LE(unbalanced, covered / 100000);
  EXPECT_EQ(inside_seen, 0u);
}

/// Surfaces that end just before coarser nodes without a surface.
double beside_nothing(Int3 p, Index) {
  const auto ball_at = [&](Vec3d centre, double radius) {
    const Vec3d d =
        Vec3d{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)} -
        centre;
    return radius - std::sqrt(dot(d, d));
  };
  return std::max(
      {ball_at({100, 60, 60}, 26.6), ball_at({60, 101, 30}, 26.9), ball_at({40, 40, 112}, 15.4)});
}

/// Nodes of the finest level that need not match a neighbour without a surface have no open edge
/// there.
class EmptyNeighbours : public Cracks {};

TEST_P(EmptyNeighbours, NeedNotBeMatched) {
  const ActiveNodes active = active_of(tree_, std::vector<double>{0});
  std::size_t covered = 0, unbalanced = 0, inside_seen = 0, unmet = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const RandomCut random(grid_, seed, 3 + static_cast<int>(seed));
    const Cut all = random.cut({0}), cut = random.cut({0}, &active);
    for (std::size_t i = 0; i < cut.nodes.size(); ++i)
      unmet += tree_.active(cut.nodes[i].key, 0) && cut.nodes[i].coarser != all.nodes[i].coarser;
    Rasteriser raster = picture(static_cast<int>(seed));
    for (const NodeMesh& mesh : meshes_of(cut)) raster.draw(mesh);
    for (const Rasteriser::Pixel& pixel : raster.pixels()) {
      covered += pixel.front > 0;
      unbalanced += pixel.front != pixel.back;
      inside_seen += pixel.nearest_is_back;
    }
  }
  EXPECT_GT(covered, 100000u);
  EXPECT_GT(unmet, 10u);
  EXPECT_LE(unbalanced, covered / 100000);
  EXPECT_EQ(inside_seen, 0u);
}

/// A shape that coarse levels have as well.
class Holes : public Cracks {};

/// Where the finest mesh covers a neighbourhood of pixels, each cut covers the pixel.
TEST_P(Holes, AreNotInsideTheSilhouette) {
  constexpr int kCoarseCell = 8 * kPicture / (2 * 68);  // of the coarsest level, pixels
  Cut finest;
  for_each_point({{0, 0, 0}, grid_.level(0).nodes}, [&](Int3 p) {
    finest.nodes.push_back({{0, p}});
  });
  Rasteriser whole = picture(0);
  for (const NodeMesh& mesh : meshes_of(finest)) whole.draw(mesh);
  const auto shown = [](const Rasteriser& r, int x, int y) {
    return r.pixels()[static_cast<std::size_t>(y * kPicture + x)].front > 0;
  };
  for (unsigned seed = 1; seed <= 12; ++seed) {
    Rasteriser raster = picture(0);
    for (const NodeMesh& mesh : meshes_of(RandomCut(grid_, seed, static_cast<int>(seed)).cut({0})))
      raster.draw(mesh);
    std::size_t inside = 0, missing = 0;
    const int r = kCoarseCell;
    for (int y = r; y < kPicture - r; ++y)
      for (int x = r; x < kPicture - r; ++x) {
        bool all = true;
        for (const int d : {-r, 0, r}) all &= shown(whole, x + d, y) && shown(whole, x, y + d);
        inside += all;
        missing += all && !shown(raster, x, y);
      }
    EXPECT_GT(inside, 50000u);
    EXPECT_EQ(missing, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(
    ClosedSurfaces, Cracks,
    ::testing::Values(Shape{"ball", ball}, Shape{"gyroid", gyroid_ball}, Shape{"blobs", blobs},
                      Shape{"gyroid_flat", gyroid_ball, 0, kFlat},
                      Shape{"blobs_flat", blobs, 0, kFlat}, Shape{"blobs_turns", blobs, 0, kTurns},
                      Shape{"gyroid_turns", gyroid_ball, 0, kTurns},
                      Shape{"ball_of_one_level", ball, 1}, Shape{"blobs_of_one_level", blobs, 1}),
    [](const auto& shape) { return shape.param.name; });

INSTANTIATE_TEST_SUITE_P(ClosedSurfaces, EmptyNeighbours,
                         ::testing::Values(Shape{"balls", beside_nothing},
                                           Shape{"balls_flat", beside_nothing, 0, kFlat},
                                           Shape{"balls_of_one_level", beside_nothing, 1}),
                         [](const auto& shape) { return shape.param.name; });

INSTANTIATE_TEST_SUITE_P(ClosedSurfaces, Holes,
                         ::testing::Values(Shape{"ball", ball},
                                           Shape{"ball_of_one_level", ball, 1}),
                         [](const auto& shape) { return shape.param.name; });

}  // namespace
}  // namespace isobrick::test

#include "viewer/scene/device_mesher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <future>
#include <limits>
#include <vector>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/random_cut.h"
#include "viewer/scene/node_mesher.h"

namespace isobrick::test {
namespace {

template <class T>
bool same_bytes(const PodBuffer<T>& a, const PodBuffer<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

/// A device makes the same bytes as this thread.
class Device : public testing::Test {
 protected:
  void SetUp() override {
    device_ = open_device_mesher(std::nullopt, std::uint64_t{64} << 20);
    if (!device_) GTEST_SKIP() << "there is no CUDA device";
  }

  void expect_same(std::shared_ptr<const BrickSource> source, const Cut& cut) {
    const NodeGrid grid(source->info());
    ResidentBricks bricks(source, std::uint64_t{1} << 30);
    NodeMesher mesher(grid, bricks, {1, 2, 3});
    const double isovalue = cut.isovalues.front();
    // Requested together, so that one launch has grids of all kinds.
    std::vector<std::promise<NodeMesh>> made(cut.nodes.size());
    for (std::size_t i = 0; i < made.size(); ++i) {
      const CutNode& node = cut.nodes[i];
      const GridView view = mesher.grid(node.key, isovalue, node.coarser, Always(),
                                        NodeMesher::Form::stored_if_possible);
      stored_ += view.stored.samples != nullptr;
      ASSERT_TRUE(device_->make(view, {}, [&, i](NodeMesh&& mesh, const std::string& failure) {
        EXPECT_EQ(failure, "");
        made[i].set_value(std::move(mesh));
      }));
    }
    for (std::size_t i = 0; i < made.size(); ++i) {
      const CutNode& node = cut.nodes[i];
      const NodeMesh a = mesher.mesh(node.key, isovalue, node.coarser, Always());
      const NodeMesh b = made[i].get_future().get();
      EXPECT_TRUE(same_bytes(a.mesh.positions, b.mesh.positions) &&
                  same_bytes(a.mesh.normals, b.mesh.normals) &&
                  same_bytes(a.mesh.triangles, b.mesh.triangles))
          << "node " << node.key.node.x << ' ' << node.key.node.y << ' ' << node.key.node.z
          << " of level " << node.key.level << ", " << a.mesh.triangles.size() << " and "
          << b.mesh.triangles.size() << " triangles";
      EXPECT_EQ(a.seam_triangles, b.seam_triangles);
      triangles_ += a.triangles();
      seam_strips_ += a.seam_triangles;
    }
  }

  std::shared_ptr<DeviceMesher> device_;
  std::uint64_t triangles_ = 0, seam_strips_ = 0;
  int stored_ = 0;  ///< grids of stored samples
};

template <class T>
std::shared_ptr<MemoryBricks> volume_of(Int3 extent, const std::function<T(Int3)>& f,
                                        const MemoryBricks::Options& options = {}) {
  return std::make_shared<MemoryBricks>(extent, f, options);
}

TEST_F(Device, MakesTheSameMeshesInCutsOfManyLevels) {
  const Index n = 171;
  for (const auto& field : {ball, gyroid_ball, blobs}) {
    const auto source =
        volume_of<float>({n, n, n}, [&](Int3 p) { return static_cast<float>(field(p, n)); });
    const NodeGrid grid(source->info());
    for (unsigned seed = 1; seed < 4; ++seed)
      expect_same(source, RandomCut(grid, seed, 8).cut({0.013}));
  }
  EXPECT_GT(triangles_, 100'000u);
  EXPECT_GT(seam_strips_, 1'000u);
}

TEST_F(Device, MakesTheSameMeshesWhereTheVolumeEndsAndAxesDiffer) {
  MemoryBricks::Options options;
  options.transform.spacing = {0.5, 1, 2.25};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, -1};  // mirrored
  const auto source = volume_of<std::uint8_t>(
      {150, 67, 93},
      [](Int3 p) {
        return static_cast<std::uint8_t>((p.x * 7 + p.y * 13 + p.z * p.x * 3) / 16 % 97 + 60);
      },
      options);
  const NodeGrid grid(source->info());
  for (unsigned seed = 1; seed < 3; ++seed) {
    expect_same(source, RandomCut(grid, seed, 3).cut({100}));  // samples that equal the isovalue
    expect_same(source, RandomCut(grid, seed, 3).cut({100.25}));
  }
  EXPECT_GT(triangles_, 100'000u);
}

/// Every type of stored samples, with blocks that are not needed and absent bricks.
template <class T>
class DeviceOfType : public Device {};
using StoredTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t>;
TYPED_TEST_SUITE(DeviceOfType, StoredTypes);

TYPED_TEST(DeviceOfType, MakesTheSameMeshesOfStoredSamples) {
  const Index n = 150;
  MemoryBricks::Options options;
  options.fill_value = 30;
  const auto source = volume_of<TypeParam>(
      {n, n, n}, [&](Int3 p) { return static_cast<TypeParam>(30 + std::max(0.0, ball(p, n))); },
      options);
  const NodeGrid grid(source->info());
  Cut cut;
  for_each_point({{0, 0, 0}, grid.level(0).nodes}, [&](Int3 p) {
    cut.nodes.push_back({.key = {0, p}});
  });
  for (const double isovalue : {45.5, 40.0}) {
    cut.isovalues = {isovalue};
    this->expect_same(source, cut);
  }
  EXPECT_GT(this->triangles_, 10'000u);
  EXPECT_EQ(this->stored_, 2 * 27);
}

TEST_F(Device, MakesTheSameMeshesAroundWhatIsNoNumber) {
  const Index n = 100;
  const auto source = volume_of<float>({n, n, n}, [&](Int3 p) -> float {
    if (p.x > 60 && p.y > 60) return std::numeric_limits<float>::quiet_NaN();
    if (p.x == 20) return std::numeric_limits<float>::infinity();
    return static_cast<float>(blobs(p, n));
  });
  const NodeGrid grid(source->info());
  for (unsigned seed = 1; seed < 3; ++seed) expect_same(source, RandomCut(grid, seed, 3).cut({0}));
  EXPECT_GT(triangles_, 10'000u);
}

}  // namespace
}  // namespace isobrick::test

// A stream whose device is full.

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <vector>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/random_cut.h"
#include "tests/viewer/scene/test_device.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick::test {
namespace {

constexpr std::uint64_t kMeshBytes = 1000;

/// A device with space for `places` meshes; other meshes go to host memory.
class SmallDevice final : public TestDevice {
 public:
  explicit SmallDevice(int places)
      : places_(places), free_(std::make_shared<std::atomic<int>>(places)) {}
  /// Bytes of the meshes that are alive.
  std::uint64_t held() const { return static_cast<std::uint64_t>(places_ - *free_) * kMeshBytes; }
  bool make(const GridView&, NodeMesh mesh, Callback done) override {
    if (*free_ > 0) {
      mesh.device = std::make_shared<const SlotMesh>(free_);
      mesh.device_triangles = 1;
      mesh.device_bytes = kMeshBytes;
    } else {
      mesh.mesh.triangles.resize(1);
    }
    done(std::move(mesh), "");
    return true;
  }
  std::vector<DeviceBlock> shared_blocks() const override { return {{}}; }

 private:
  struct SlotMesh final : DeviceMesh {
    explicit SlotMesh(std::shared_ptr<std::atomic<int>> f) : free(std::move(f)) { --*free; }
    ~SlotMesh() override { ++*free; }
    std::shared_ptr<std::atomic<int>> free;
  };
  int places_;
  std::shared_ptr<std::atomic<int>> free_;
};

TEST(StreamDevice, OlderMeshesMakeRoomBeforeTheBudgetIsReached) {
  const Index n = 150;
  const auto source = std::make_shared<MemoryBricks>(
      Int3{n, n, n},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(gyroid_ball(p, n)); }),
      MemoryBricks::Options{});
  const auto tree = std::make_shared<const NodeTree>(*source);
  const RandomCut cut(tree->grid(), 1, 100);
  const auto show = [&](SceneStream& stream, double isovalue) {
    stream.set_cut(cut.cut({isovalue}));
    EXPECT_TRUE(stream.wait_idle(60));
    return stream.drawable();
  };
  SceneStream all(source, tree, {.threads = 1});
  all.set_device(std::make_shared<SmallDevice>(1 << 20));
  show(all, 0);
  const auto meshes = static_cast<int>(all.counters().meshes_made);
  ASSERT_GT(meshes, 20);
  // The budget is larger, since fragmentation takes some.
  const int places = meshes * 3 / 2;
  SceneStream stream(
      source, tree,
      {.threads = 1, .device_bytes = (static_cast<std::uint64_t>(places) + 1) * kMeshBytes});
  const auto device = std::make_shared<SmallDevice>(places);
  stream.set_device(device);
  for (const double isovalue : {0.0, 0.1, 0.2, 0.3, 0.4}) {
    const auto drawn = show(stream, isovalue);
    const auto there = std::count_if(drawn->nodes.begin(), drawn->nodes.end(),
                                     [](const NodeDraw& node) { return node.mesh->device; });
    EXPECT_TRUE(drawn->complete);
    EXPECT_GT(static_cast<std::size_t>(there), drawn->nodes.size() / 3) << isovalue;
  }
  // Shown meshes keep their space, so they count.
  for (const double isovalue : {0.5, 0.6, 0.7}) {
    stream.set_cut(cut.cut({isovalue}));
    EXPECT_TRUE(stream.wait_idle(60));
    EXPECT_EQ(stream.counters().device_bytes, device->held()) << isovalue;
  }
}

}  // namespace
}  // namespace isobrick::test

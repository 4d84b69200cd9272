#include <atomic>
#include <utility>

#include "isobrick/core/error.h"
#include "isobrick/gpu/device.h"
#include "isobrick/gpu/grid_extractor.h"
#include "isobrick/gpu/mesh_memory.h"
#include "isobrick/viewer/device_mesher.h"

namespace isobrick {
namespace {

DeviceBlock block_of(std::shared_ptr<const gpu::MeshBlock> block) {
  return {block->file, block->bytes, block->vertices, block->triangles, block};
}

class SharedMesh final : public DeviceMesh {
 public:
  SharedMesh(std::shared_ptr<gpu::MeshMemory> memory, gpu::MeshSpan span)
      : memory_(std::move(memory)), span_(std::move(span)) {
    block = block_of(span_.block);
    first_vertex = span_.first_vertex;
    vertices = span_.vertices;
    first_triangle = span_.first_triangle;
    triangles = span_.triangles;
  }
  ~SharedMesh() override { memory_->give_back(span_); }
  const gpu::GridMeshPlace& place() const { return span_.place; }

 private:
  std::shared_ptr<gpu::MeshMemory> memory_;
  gpu::MeshSpan span_;
};

/// What workers and meshes share.
struct Shared {
  int device = 0;
  std::string name;
  std::shared_ptr<gpu::MeshMemory> memory;  ///< null: meshes go through host memory
  std::atomic<bool> sharing = false;
};

class Worker final : public GridWorker {
 public:
  explicit Worker(std::shared_ptr<const Shared> shared)
      : shared_(std::move(shared)), extractor_(shared_->device) {}

  void make(const GridView& grid, NodeMesh& out) override {
    const gpu::GridExtractor::Size size = extractor_.count(grid);
    out.ribbon_triangles = size.ribbon_triangles;
    if (size.triangles == 0) return;
    if (shared_->sharing)
      if (auto span = shared_->memory->take(size.vertices, size.triangles)) {
        const auto mesh = std::make_shared<SharedMesh>(shared_->memory, std::move(*span));
        extractor_.write(mesh->place());
        out.device = mesh;
        out.device_triangles = size.triangles;
        out.device_bytes = size.vertices * 2 * sizeof(Vec3f) + size.triangles * sizeof(Triangle);
        return;
      }
    extractor_.download(out.mesh);
  }

 private:
  std::shared_ptr<const Shared> shared_;
  gpu::GridExtractor extractor_;
};

class CudaMesher final : public DeviceMesher {
 public:
  explicit CudaMesher(std::shared_ptr<Shared> shared) : shared_(std::move(shared)) {}
  std::unique_ptr<GridWorker> worker() override { return std::make_unique<Worker>(shared_); }
  const std::string& name() const override { return shared_->name; }
  std::optional<DeviceBlock> shared_block() const override {
    if (!shared_->sharing) return std::nullopt;
    return block_of(shared_->memory->first_block());
  }
  void share_nothing() override { shared_->sharing = false; }
  std::uint64_t bytes() const override { return shared_->memory ? shared_->memory->bytes() : 0; }

 private:
  std::shared_ptr<Shared> shared_;
};

}  // namespace

std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>& drawing,
                                                 std::uint64_t budget) {
  const int count = gpu::device_count();
  if (count == 0) return nullptr;
  auto shared = std::make_shared<Shared>();
  bool draws = false;
  for (int i = 0; drawing && i < count && !draws; ++i)
    if (gpu::device_id(i) == *drawing) {
      shared->device = i;
      draws = true;
    }
  shared->name = gpu::open_device(shared->device).name;
  if (draws) {
    try {
      shared->memory = std::make_shared<gpu::MeshMemory>(shared->device, budget);
      shared->sharing = true;
    } catch (const Error&) {  // through host memory, then
    }
  }
  return std::make_shared<CudaMesher>(std::move(shared));
}

}  // namespace isobrick

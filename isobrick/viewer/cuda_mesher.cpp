#include <algorithm>
#include <atomic>
#include <optional>
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

  /// Room is taken for what meshes were like before, so that the device is waited for once.
  void make(const GridView& grid, NodeMesh& out) override {
    std::optional<gpu::MeshSpan> span;
    if (shared_->sharing) span = shared_->memory->take(likely_vertices_, likely_triangles_);
    const SpanOwner owner{shared_->memory.get(), span};
    const auto size = extractor_.make(grid, span ? span->place : gpu::GridMeshPlace{});
    out.ribbon_triangles = size.ribbon_triangles;
    if (size.triangles == 0) return;
    likely_vertices_ = std::max(size.vertices + size.vertices / 4, likely_vertices_ / 8 * 7);
    likely_triangles_ = std::max(size.triangles + size.triangles / 4, likely_triangles_ / 8 * 7);
    if (span && span->place.holds(size.vertices, size.triangles)) {
      shared_->memory->trim(*span, size.vertices, size.triangles);
      return hand_out(*std::exchange(span, std::nullopt), out);
    }
    owner.give_back();
    if (shared_->sharing) span = shared_->memory->take(size.vertices, size.triangles);
    if (!span) return extractor_.download(out.mesh);
    extractor_.write(span->place);
    hand_out(*std::exchange(span, std::nullopt), out);
  }

 private:
  /// Gives room back that no mesh has got.
  struct SpanOwner {
    gpu::MeshMemory* memory;
    std::optional<gpu::MeshSpan>& span;
    ~SpanOwner() { give_back(); }
    void give_back() const {
      if (span) memory->give_back(*std::exchange(span, std::nullopt));
    }
  };

  void hand_out(gpu::MeshSpan&& span, NodeMesh& out) {
    out.device_triangles = span.triangles;
    out.device_bytes = span.vertices * 2 * sizeof(Vec3f) + span.triangles * sizeof(Triangle);
    out.device = std::make_shared<SharedMesh>(shared_->memory, std::move(span));
  }

  std::shared_ptr<const Shared> shared_;
  gpu::GridExtractor extractor_;
  std::uint32_t likely_vertices_ = 1u << 14, likely_triangles_ = 1u << 15;
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

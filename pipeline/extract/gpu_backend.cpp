#include "pipeline/extract/gpu_backend.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/host_memory.h"
#include "gpu/stream/gpu_extractor.h"
#include "pipeline/extract/device_bricks.h"

namespace isobrick::inline v0 {
namespace {

/// Bricks in host memory, which the device reads.
class HostBricks final : public BrickMemory {
 public:
  explicit HostBricks(int device) : device_(device) {}
  std::shared_ptr<std::byte> room(std::size_t bytes) override {
    return gpu::host_memory(device_, bytes);
  }

 private:
  int device_;
};

class CudaSession final : public GpuSession {
 public:
  explicit CudaSession(int device) : device_(device), info_(gpu::open_device(device)) {}

  std::uint64_t plan(PassRequests requests, std::uint64_t device_budget, std::uint64_t host_budget,
                     std::uint64_t other_host_bytes, std::uint64_t most_bricks) override {
    const Lattice& lattice = requests.front().level->lattice;
    const int threads = requests.front().threads;
    const bool packed = requests.front().packed;
    if (device_budget == 0) device_budget = info_.free_bytes - info_.free_bytes / 10;
    std::vector<SurfaceOptions> surfaces;
    for (const ExtractRequest& request : requests) surfaces.push_back(request.surface);
    const auto fit = [&](std::uint64_t bricks) {
      sizes_ = gpu::fit_stream_sizes(lattice, surfaces, device_budget, host_budget,
                                     other_host_bytes, {bricks, threads, packed});
    };
    fit(std::min(most_bricks, gpu::preferred_pool_bricks(lattice, threads)));
    bricks_ = std::make_unique<HostBricks>(device_);
    if (pool_bricks() > 0 && !make_pool(lattice)) fit(0);
    return gpu::host_bytes_of(lattice, sizes_);
  }

  std::size_t preferred_batch() const override { return sizes_.front().tiles; }
  std::size_t pool_bricks() const override { return sizes_.front().pool.bricks; }
  BrickMemory& bricks() override { return *bricks_; }

  std::unique_ptr<SurfaceExtractor> make_surface(const ExtractRequest& request, std::size_t number,
                                                 MeshSink& sink) override {
    auto surface = std::make_unique<gpu::GpuExtractor>(
        device_, request.level->lattice, request.surface, sizes_[number], sink, pool_);
    if (const auto& part = request.part) surface->make_part(part->tiles, *part->places);
    return surface;
  }

  void report(ExtractReport& report) const override {
    report.backend = "cuda";
    report.device = info_.name;
    report.pool_bricks = pool_bricks();
    const std::uint64_t free = gpu::open_device(device_).free_bytes;
    report.device_bytes_in_use = info_.free_bytes - std::min(free, info_.free_bytes);
  }

 private:
  /// False when the device has less room than it reported.
  bool make_pool(const Lattice& lattice) {
    const gpu::PoolSizes& pool = sizes_.front().pool;
    try {
      auto bricks = std::make_unique<DeviceBricks>(device_, lattice, pool);
      pool_ = bricks->pool();
      bricks_ = std::move(bricks);
    } catch (const gpu::OutOfDeviceMemory&) {
      return false;
    }
    return true;
  }

  int device_;
  gpu::DeviceInfo info_;
  std::vector<gpu::StreamSizes> sizes_;  ///< of each surface
  std::shared_ptr<gpu::BrickPool> pool_;
  std::unique_ptr<BrickMemory> bricks_;
};

}  // namespace

bool built_with_cuda() { return true; }
int cuda_device_count() { return gpu::device_count(); }

std::unique_ptr<GpuSession> open_gpu(int device) { return std::make_unique<CudaSession>(device); }

}  // namespace isobrick

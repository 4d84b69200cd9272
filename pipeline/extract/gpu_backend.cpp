#include "pipeline/extract/gpu_backend.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/host_memory.h"
#include "gpu/stream/brick_pool.h"
#include "gpu/stream/gpu_extractor.h"

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

/// Bricks on the device.
class DeviceBricks final : public BrickMemory {
 public:
  /// `packed_bytes`: the most that a packed brick takes; 0: bricks are decoded before.
  DeviceBricks(std::shared_ptr<gpu::BrickPool> pool, std::size_t ahead, std::size_t packed_bytes)
      : pool_(std::move(pool)), ahead_(ahead), packed_bytes_(packed_bytes) {}
  std::shared_ptr<std::byte> room(std::size_t bytes) override {
    return {pool_, pool_->take(bytes)};
  }
  std::byte* begin(int thread, std::byte*) override { return pool_->begin(thread); }
  void end(int thread, std::byte* place) override { pool_->end(thread, place); }
  bool takes_packed() const override { return packed_bytes_ > 0; }
  std::span<std::byte> begin_packed(int thread) override {
    return {pool_->begin(thread), packed_bytes_};
  }
  void end_packed(int thread, std::byte* place, const PackedLoad& brick) override {
    pool_->end_packed(thread, place, brick.bytes, brick.brick, brick.range);
  }
  std::optional<Int3> find_damaged(bool all) override { return pool_->find_damaged(all); }
  std::size_t bricks_ahead() const override { return ahead_; }

 private:
  std::shared_ptr<gpu::BrickPool> pool_;
  std::size_t ahead_, packed_bytes_;
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
    return std::make_unique<gpu::GpuExtractor>(device_, request.level->lattice, request.surface,
                                               sizes_[number], sink, pool_);
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
      pool_ = std::make_shared<gpu::BrickPool>(device_, lattice, pool.bricks, pool.threads,
                                               pool.packed);
    } catch (const gpu::OutOfDeviceMemory&) {
      return false;
    }
    bricks_ = std::make_unique<DeviceBricks>(
        pool_, gpu::bricks_ahead(lattice, pool),
        pool.packed ? gpu::BrickPool::buffer_bytes(lattice, true) : 0);
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

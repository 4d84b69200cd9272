#include "gpu/memory/pool_memory.h"

#include <limits>
#include <map>
#include <mutex>

#include "gpu/memory/cuda_check.h"

namespace isobrick::inline v0::gpu {
namespace {

class PoolMemory final : public DeviceMemory {
 public:
  explicit PoolMemory(int device) {
    cudaMemPoolProps properties{};
    properties.allocType = cudaMemAllocationTypePinned;
    properties.location.type = cudaMemLocationTypeDevice;
    properties.location.id = device;
    check(cudaMemPoolCreate(&pool_, &properties));
    std::uint64_t kept = std::numeric_limits<std::uint64_t>::max();
    check(cudaMemPoolSetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &kept));
  }
  PoolMemory(const PoolMemory&) = delete;
  PoolMemory& operator=(const PoolMemory&) = delete;
  ~PoolMemory() override { (void)cudaMemPoolDestroy(pool_); }

  void* allocate(std::size_t bytes, CUstream_st* stream) override {
    void* memory = nullptr;
    check(cudaMallocFromPoolAsync(&memory, bytes, pool_, stream));
    return memory;
  }
  void free(void* memory, std::size_t, CUstream_st* stream) noexcept override {
    (void)cudaFreeAsync(memory, stream);
  }

 private:
  cudaMemPool_t pool_ = nullptr;
};

}  // namespace

std::shared_ptr<DeviceMemory> pool_memory() {
  static std::mutex mutex;
  static std::map<int, std::weak_ptr<DeviceMemory>> pools;
  int device = 0;
  check(cudaGetDevice(&device));
  const std::lock_guard lock(mutex);
  std::shared_ptr<DeviceMemory> pool = pools[device].lock();
  if (!pool) pools[device] = pool = std::make_shared<PoolMemory>(device);
  return pool;
}

}  // namespace isobrick::gpu

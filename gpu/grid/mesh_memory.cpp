#include "gpu/grid/mesh_memory.h"

#include <cuda.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <mutex>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/cuda_check.h"
#include "gpu/memory/mesh_arrays.h"

namespace isobrick::inline v0::gpu {
namespace {

constexpr std::uint32_t kMaxVertices = 1u << 22, kFewestVertices = 1u << 17;
constexpr std::uint64_t kVertexBytes = 4 * sizeof(Vec3f);  // with a normal and two triangles

/// A function of the driver; the program is not linked to it.
template <class F>
F driver_function(const char* name) {
  void* function = nullptr;
  cudaDriverEntryPointQueryResult found{};
  check(cudaGetDriverEntryPointByVersion(name, &function, 12000, cudaEnableDefault, &found));
  if (found != cudaDriverEntryPointSuccess || function == nullptr)
    throw Error(fmt::format("the CUDA driver has no {}", name));
  return reinterpret_cast<F>(function);
}

struct Driver {
  decltype(&cuMemCreate) create = driver_function<decltype(&cuMemCreate)>("cuMemCreate");
  decltype(&cuMemRelease) release = driver_function<decltype(&cuMemRelease)>("cuMemRelease");
  decltype(&cuMemExportToShareableHandle) export_handle =
      driver_function<decltype(&cuMemExportToShareableHandle)>("cuMemExportToShareableHandle");
  decltype(&cuMemAddressReserve) reserve =
      driver_function<decltype(&cuMemAddressReserve)>("cuMemAddressReserve");
  decltype(&cuMemAddressFree) free =
      driver_function<decltype(&cuMemAddressFree)>("cuMemAddressFree");
  decltype(&cuMemMap) map = driver_function<decltype(&cuMemMap)>("cuMemMap");
  decltype(&cuMemUnmap) unmap = driver_function<decltype(&cuMemUnmap)>("cuMemUnmap");
  decltype(&cuMemSetAccess) set_access =
      driver_function<decltype(&cuMemSetAccess)>("cuMemSetAccess");
};

void check_driver(CUresult result, const char* what) {
  if (result == CUDA_SUCCESS) return;
  const std::string message = fmt::format(
      "CUDA: memory to share with OpenGL: {} failed with error {}", what, static_cast<int>(result));
  if (result == CUDA_ERROR_OUT_OF_MEMORY) throw OutOfDeviceMemory(message);
  throw Error(message);
}

std::uint32_t block_vertices(std::uint64_t budget) {
  std::uint32_t vertices = kMaxVertices;
  while (vertices > kFewestVertices && vertices * kVertexBytes > budget / 4) vertices /= 2;
  return vertices;
}

}  // namespace

/// A block with its bookkeeping.
class OwnedMeshBlock final : public SharedMeshBlock {
 public:
  OwnedMeshBlock(const Driver& driver, int device, std::uint32_t vertex_room)
      : driver_(driver), free_(vertex_room, 2 * vertex_room) {
    vertices = vertex_room;
    triangles = 2 * vertex_room;
    bytes = kVertexBytes * vertex_room;
    CUmemAllocationProp properties{};
    properties.type = CU_MEM_ALLOCATION_TYPE_PINNED;
    properties.requestedHandleTypes = CU_MEM_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR;
    properties.location.type = CU_MEM_LOCATION_TYPE_DEVICE;
    properties.location.id = device;
    check_driver(driver_.create(&memory_, bytes, &properties, 0), "cuMemCreate");
    try {
      check_driver(driver_.reserve(&address_, bytes, 0, 0, 0), "cuMemAddressReserve");
      check_driver(driver_.map(address_, bytes, 0, memory_, 0), "cuMemMap");
      mapped_ = true;
      CUmemAccessDesc access{};
      access.location = properties.location;
      access.flags = CU_MEM_ACCESS_FLAGS_PROT_READWRITE;
      check_driver(driver_.set_access(address_, bytes, &access, 1), "cuMemSetAccess");
      check_driver(
          driver_.export_handle(&file, memory_, CU_MEM_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR, 0),
          "cuMemExportToShareableHandle");
      // The driver has addresses as integers.
      // NOLINTNEXTLINE(performance-no-int-to-ptr)
      Arena arena(reinterpret_cast<std::byte*>(address_), bytes);
      arrays_ = MeshArrays::take(arena, vertices, triangles, true);
    } catch (...) {
      end();
      throw;
    }
  }
  ~OwnedMeshBlock() { end(); }
  OwnedMeshBlock(const OwnedMeshBlock&) = delete;
  OwnedMeshBlock& operator=(const OwnedMeshBlock&) = delete;

  std::optional<MeshRange> take(std::uint32_t vertex_count, std::uint32_t triangle_count) {
    const std::lock_guard lock(mutex_);
    return free_.take(vertex_count, triangle_count);
  }
  MeshRange trim(const MeshRange& range, std::uint32_t vertex_count, std::uint32_t triangle_count) {
    const std::lock_guard lock(mutex_);
    return free_.trim(range, vertex_count, triangle_count);
  }
  void give_back(const MeshRange& range) noexcept {
    const std::lock_guard lock(mutex_);
    free_.give_back(range);
  }
  GridMeshPlace place(const MeshRange& range) const {
    return {{arrays_.positions + range.first_vertex, arrays_.normals + range.first_vertex,
             arrays_.triangles + range.first_triangle},
            range.vertices,
            range.triangles};
  }

 private:
  void end() {
    if (file >= 0) (void)close(file);
    if (mapped_) (void)driver_.unmap(address_, bytes);
    if (address_ != 0) (void)driver_.free(address_, bytes);
    (void)driver_.release(memory_);
  }

  Driver driver_;
  CUmemGenericAllocationHandle memory_ = 0;
  CUdeviceptr address_ = 0;
  bool mapped_ = false;
  MeshArrays arrays_;
  std::mutex mutex_;
  MeshFreeList free_;
};

MeshSlice::~MeshSlice() {
  if (block_) block_->give_back(range_);
}
std::shared_ptr<const SharedMeshBlock> MeshSlice::block() const { return block_; }
GridMeshPlace MeshSlice::place() const { return block_->place(range_); }
void MeshSlice::trim(std::uint32_t vertices, std::uint32_t triangles) {
  range_ = block_->trim(range_, vertices, triangles);
}

struct MeshMemory::Impl {
  mutable std::mutex mutex;
  std::vector<std::shared_ptr<OwnedMeshBlock>> blocks;

  Impl(int device, std::uint64_t budget) {
    const std::uint32_t room = block_vertices(budget);
    const std::uint64_t count = budget / (room * kVertexBytes);
    if (count == 0)
      throw Error(
          fmt::format("a budget of {} bytes is too small for meshes on the device: {} are "
                      "needed at least",
                      budget, room * kVertexBytes));
    const Driver driver;
    try {
      while (blocks.size() < count)
        blocks.push_back(std::make_shared<OwnedMeshBlock>(driver, device, room));
    } catch (const OutOfDeviceMemory&) {
      if (blocks.empty()) throw;  // others have the rest: what is there must do
    }
  }
};

MeshMemory::MeshMemory(int device, std::uint64_t budget)
    : impl_(std::make_unique<Impl>(device, budget)) {}
MeshMemory::~MeshMemory() = default;

std::optional<MeshSlice> MeshMemory::take(std::uint32_t vertices, std::uint32_t triangles) {
  const std::lock_guard lock(impl_->mutex);
  for (const std::shared_ptr<OwnedMeshBlock>& block : impl_->blocks)
    if (const auto range = block->take(vertices, triangles)) return MeshSlice(block, *range);
  return std::nullopt;
}

void MeshMemory::keep(std::size_t count) {
  const std::lock_guard lock(impl_->mutex);
  if (count < impl_->blocks.size()) impl_->blocks.resize(count);
}

std::vector<std::shared_ptr<const SharedMeshBlock>> MeshMemory::blocks() const {
  const std::lock_guard lock(impl_->mutex);
  return {impl_->blocks.begin(), impl_->blocks.end()};
}

std::uint64_t MeshMemory::bytes() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->blocks.empty() ? 0 : impl_->blocks.size() * impl_->blocks.front()->bytes;
}

}  // namespace isobrick::gpu

#include "gpu/grid/mesh_memory.h"

#include <cuda.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <mutex>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "core/free_list.h"
#include "gpu/memory/cuda_check.h"

namespace isobrick::gpu {
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

/// A block with its bookkeeping.
class Block final : public MeshBlock {
 public:
  Block(const Driver& driver, int device, std::uint32_t vertex_room)
      : free_vertices(vertex_room), free_triangles(2 * vertex_room), driver_(driver) {
    vertices = vertex_room;
    triangles = 2 * vertex_room;
    bytes = kVertexBytes * vertex_room;
    CUmemAllocationProp properties{};
    properties.type = CU_MEM_ALLOCATION_TYPE_PINNED;
    properties.requestedHandleTypes = CU_MEM_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR;
    properties.location = {CU_MEM_LOCATION_TYPE_DEVICE, {device}};
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
    } catch (...) {
      end();
      throw;
    }
  }
  ~Block() { end(); }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  GridMeshPlace place(std::uint32_t first_vertex, std::uint32_t vertex_count,
                      std::uint32_t first_triangle, std::uint32_t triangle_count) const {
    auto* positions = reinterpret_cast<Vec3f*>(address_);
    Vec3f* normals = positions + vertices;
    auto* first = reinterpret_cast<Triangle*>(normals + vertices);
    return {positions + first_vertex, normals + first_vertex, first + first_triangle, vertex_count,
            triangle_count};
  }

  FreeList free_vertices, free_triangles;

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
};

std::uint32_t block_vertices(std::uint64_t budget) {
  std::uint32_t vertices = kMaxVertices;
  while (vertices > kFewestVertices && vertices * kVertexBytes > budget / 4) vertices /= 2;
  return vertices;
}

}  // namespace

struct MeshMemory::Impl {
  mutable std::mutex mutex;
  std::vector<std::shared_ptr<Block>> blocks;

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
      while (blocks.size() < count) blocks.push_back(std::make_shared<Block>(driver, device, room));
    } catch (const OutOfDeviceMemory&) {
      if (blocks.empty()) throw;  // others have the rest: what is there must do
    }
  }

  void give_back(const MeshSpan& span) {
    for (const std::shared_ptr<Block>& block : blocks)
      if (block == span.block) {
        block->free_vertices.give_back(span.first_vertex, span.vertices);
        block->free_triangles.give_back(span.first_triangle, span.triangles);
      }
  }

  std::optional<MeshSpan> take_from(const std::shared_ptr<Block>& block, std::uint32_t vertices,
                                    std::uint32_t triangles) {
    const auto vertex = block->free_vertices.take(vertices);
    if (!vertex) return std::nullopt;
    const auto triangle = block->free_triangles.take(triangles);
    if (triangle)
      return MeshSpan{block,     *vertex,   vertices,
                      *triangle, triangles, block->place(*vertex, vertices, *triangle, triangles)};
    block->free_vertices.give_back(*vertex, vertices);
    return std::nullopt;
  }
};

MeshMemory::MeshMemory(int device, std::uint64_t budget)
    : impl_(std::make_unique<Impl>(device, budget)) {}
MeshMemory::~MeshMemory() = default;

std::optional<MeshSpan> MeshMemory::take(std::uint32_t vertices, std::uint32_t triangles) {
  const std::lock_guard lock(impl_->mutex);
  for (const std::shared_ptr<Block>& block : impl_->blocks)
    if (auto span = impl_->take_from(block, vertices, triangles)) return span;
  return std::nullopt;
}

void MeshMemory::trim(MeshSpan& span, std::uint32_t vertices, std::uint32_t triangles) {
  MeshSpan rest = span;
  rest.first_vertex += vertices;
  rest.vertices -= vertices;
  rest.first_triangle += triangles;
  rest.triangles -= triangles;
  give_back(rest);
  span.vertices = span.place.vertices = vertices;
  span.triangles = span.place.triangle_count = triangles;
}

void MeshMemory::give_back(const MeshSpan& span) {
  const std::lock_guard lock(impl_->mutex);
  impl_->give_back(span);
}

void MeshMemory::keep(std::size_t count) {
  const std::lock_guard lock(impl_->mutex);
  if (count < impl_->blocks.size()) impl_->blocks.resize(count);
}

std::vector<std::shared_ptr<const MeshBlock>> MeshMemory::blocks() const {
  const std::lock_guard lock(impl_->mutex);
  return {impl_->blocks.begin(), impl_->blocks.end()};
}

std::uint64_t MeshMemory::bytes() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->blocks.empty() ? 0 : impl_->blocks.size() * impl_->blocks.front()->bytes;
}

}  // namespace isobrick::gpu

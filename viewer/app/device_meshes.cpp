#include "viewer/app/device_meshes.h"

#include <fmt/format.h>

#include <chrono>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "pipeline/extract/gpu_backend.h"

namespace isobrick::inline v0 {

void DeviceOpener::begin() {
  if (has_begun()) return;
  const auto id = current_gl_device_id();  // may throw
  std::promise<std::shared_ptr<DeviceMesher>> opened;
  mesher_ = opened.get_future().share();
  opener_ = std::jthread([this, id, opened = std::move(opened)]() mutable {
    try {
      opened.set_value(open_device_mesher(id, budget_));
    } catch (...) {
      opened.set_exception(std::current_exception());
    }
    if (on_change_) on_change_();
  });
}

/// Returns whether there was a block to import.
bool DeviceOpener::import_one(DeviceMesher& mesher) {
  const std::vector<DeviceBlock> blocks = mesher.shared_blocks();
  const std::size_t done = imported_.size();
  if (done == blocks.size()) return false;
  const DeviceBlock& block = blocks[done];
  try {
    imported_.emplace(
        block.owner.get(),
        std::unique_ptr<ImportedBlock>(new ImportedBlock{
            block.owner, {block.file, block.bytes, block.vertices, block.triangles}}));
  } catch (const Error&) {  // continue with the blocks imported so far
    mesher.share_only(done);
  }
  return true;
}

bool DeviceOpener::is_open() const {
  return has_begun() && mesher_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

/// The device, once is_open(); null if there is none.
DeviceMesher* DeviceOpener::mesher() const {
  try {
    return mesher_.get().get();
  } catch (const Error&) {
    return nullptr;
  }
}

bool DeviceOpener::is_done() const {
  if (!is_open()) return false;
  const DeviceMesher* const device = mesher();
  return device == nullptr || imported_.size() == device->shared_blocks().size();
}

bool DeviceOpener::import_next() {
  if (!is_open()) return false;
  DeviceMesher* const device = mesher();
  return device != nullptr && import_one(*device);
}

std::shared_ptr<DeviceMesher> DeviceOpener::get() {
  const std::shared_ptr<DeviceMesher> device = mesher_.get();
  while (device && import_one(*device)) {
  }
  return device;
}

std::uint64_t DeviceOpener::allocated_bytes() const {
  const DeviceMesher* const device = is_open() ? mesher() : nullptr;
  return device == nullptr ? 0 : device->bytes();
}

std::uint64_t DeviceOpener::reserved_bytes() const {
  return has_begun() && !is_open() ? budget_ : allocated_bytes();
}

DeviceMeshes::DeviceMeshes(SceneStream& stream, std::shared_ptr<DeviceOpener> opener)
    : stream_(stream), opener_(std::move(opener)) {}

void DeviceMeshes::use(Backend backend) {
  const bool must = backend == Backend::cuda;
  if (must && !built_with_cuda())
    throw Error("--backend cuda: this isobrick was built without CUDA; use --backend cpu");
  backend_ = backend;
  if (backend == Backend::cpu) return stream_.set_device(nullptr);
  opener_->begin();
  if (taken_over_)
    stream_.set_device(mesher_);
  else if (must || opener_->is_done())
    take_over();
  if (mesher_ && !mesher_->failure().empty()) failure_ = mesher_->failure();
  if (!must || (mesher_ && failure_.empty())) return;
  backend_ = Backend::cpu;
  throw Error(failure_.empty() ? "--backend cuda: there is no CUDA device here; use --backend cpu"
                               : failure_);
}

bool DeviceMeshes::update() {
  if (taken_over_) return false;
  const bool imported = !opener_->is_done() && opener_->import_next();
  if (opener_->is_done()) take_over();
  return imported;
}

void DeviceMeshes::take_over() {
  taken_over_ = true;
  try {
    mesher_ = opener_->get();
  } catch (const Error& e) {
    failure_ = e.what();
  }
  if (!mesher_) return;
  stream_.set_device_budget(cache_bytes(mesher_->bytes()));
  if (backend_ != Backend::cpu) stream_.set_device(mesher_);
}

TicketLock* DeviceMeshes::kernel_lock() const {
  const bool makes = backend_ != Backend::cpu && shares_memory() && mesher_->failure().empty();
  return makes ? &mesher_->kernel_lock() : nullptr;
}

bool DeviceMeshes::shares_memory() const { return mesher_ && !mesher_->shared_blocks().empty(); }

std::string DeviceMeshes::describe() const {
  const std::string failure = stream_.counters().device_failure;
  if (!failure.empty()) return fmt::format("CPU ({})", failure);
  if (backend_ == Backend::cpu) return "CPU";
  if (mesher_)
    return fmt::format("{}{}", mesher_->name(),
                       shares_memory() ? ", into OpenGL's buffers" : ", through host memory");
  if (!failure_.empty()) return fmt::format("CPU ({})", failure_);
  return taken_over_ ? "CPU (there is no CUDA device)" : "CPU";
}

const PooledMesh& DeviceMeshes::borrow(const NodeMesh& mesh, Vec3d origin) {
  const DeviceMesh& device_mesh = *mesh.device;
  const MeshPlace place = opener_->buffers_of(device_mesh.block)
                              .place(device_mesh.first_vertex, device_mesh.vertices,
                                     device_mesh.first_triangle, device_mesh.triangles);
  return borrowed_.emplace_back(MeshPool::borrow(place, origin));
}

}  // namespace isobrick

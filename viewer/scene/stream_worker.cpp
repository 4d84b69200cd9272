#include "viewer/scene/stream_worker.h"

#include <cstddef>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include "core/stopwatch.h"

namespace isobrick::inline v0 {
namespace {

NodeMesh empty_mesh(const MeshJob& job) {
  NodeMesh mesh;
  mesh.key = job.key;
  mesh.isovalue = job.isovalue;
  mesh.coarser = job.coarser;
  return mesh;
}

/// Cancels work without a request when the queue is closed.
class CloseCheck final : public CancellationToken {
 public:
  explicit CloseCheck(const RequestQueue& queue) : queue_(queue) {}
  void check() const override {
    if (queue_.closed()) throw OperationCancelled();
  }

 private:
  const RequestQueue& queue_;
};

/// Receives a mesh from the device, on the device's thread.
void receive(StreamState& state, const RequestQueue::RequestPtr& request, NodeMesh&& mesh,
             const std::string& failure, std::shared_ptr<DeviceMesher> by) {
  const bool made = failure.empty();
  if (made)
    state.add_mesh(std::move(mesh), by.get());
  else
    state.device.drop(by, failure);
  // Released before the request ends: the device's own thread should not be its last owner.
  by.reset();
  if (!made) return state.queue.retry(request);
  state.queue.finish(request);
  state.notify_change();
}

}  // namespace

StreamWorker::StreamWorker(std::shared_ptr<StreamState> state)
    : state_(std::move(state)),
      mesher_(state_->tree->grid(), state_->bricks, state_->options.origin,
              state_->options.inside) {}

void StreamWorker::run() {
  while (const RequestPtr request = state_->queue.take()) {
    if (request->is_slice())
      make_slice(request);
    else
      make_mesh(request);
    find_thin_structure();
  }
}

/// Runs after the first request, when most of the bricks are resident.
void StreamWorker::find_thin_structure() {
  try {
    if (state_->tree->thin_structure().read(state_->bricks, CloseCheck(state_->queue)))
      state_->notify_change();
  } catch (const OperationCancelled&) {
  }
}

void StreamWorker::make_mesh(const RequestPtr& request) {
  prefetch_bricks();
  const double before = mesher_.seconds();
  Stopwatch watch;
  std::optional<NodeMesh> mesh = mesh_of(request);
  const double seconds = watch.lap();
  const bool sent = request->sent_to_device();
  state_->statistics.add_seconds(mesher_.seconds() - before);
  if (mesh || sent) state_->skipping.add_mesh_seconds(seconds);
  plan_if_overdue();
  if (sent) return;  // receive() finishes the request, perhaps already
  const bool made = mesh.has_value();
  if (made) state_->add_mesh(std::move(*mesh), nullptr);
  state_->queue.finish(request);
  if (made) state_->notify_change();
}

/// Prefetches the bricks of the mesh that this thread will make after the other threads have taken
/// those before it.
void StreamWorker::prefetch_bricks() {
  const auto others = static_cast<std::size_t>(state_->threads) - 1;
  const std::optional<MeshJob> next = state_->queue.mesh_after(others);
  if (!next) return;
  try {
    mesher_.will_need(next->key, next->isovalue, next->coarser);
  } catch (const Error&) {  // reported by the thread that reads it
  }
}

/// Returns the mesh; nullopt if the request was cancelled or sent to a device.
std::optional<NodeMesh> StreamWorker::mesh_of(const RequestPtr& request) {
  const MeshJob& job = request->mesh();
  try {
    const auto read = [&](NodeMesher::Form form) {
      return mesher_.grid(job.key, job.isovalue, job.coarser, *request, form);
    };
    // The device is taken only after reading, so that a blocked read keeps no device alive.
    GridView grid = read(state_->device.is_set() ? NodeMesher::Form::stored_if_possible
                                                 : NodeMesher::Form::values);
    request->check();
    if (send(grid, request)) return std::nullopt;
    if (grid.stored.samples != nullptr) grid = read(NodeMesher::Form::values);
    return mesher_.extract(grid, empty_mesh(job));
  } catch (const OperationCancelled&) {
    return std::nullopt;
  } catch (const std::exception& e) {
    NodeMesh damaged = empty_mesh(job);
    damaged.damage = e.what();
    return damaged;
  }
}

/// Returns false without a working device.
bool StreamWorker::send(const GridView& grid, const RequestPtr& request) {
  const std::shared_ptr<DeviceMesher> device = state_->device.get();
  if (!device) return false;
  request->set_sent_to_device(true);
  const bool taken = device->make(
      grid, empty_mesh(request->mesh()),
      [state = state_, request, by = device](NodeMesh&& mesh, const std::string& failure) mutable {
        receive(*state, request, std::move(mesh), failure, std::move(by));
      });
  if (taken) return true;
  request->set_sent_to_device(false);
  state_->device.drop(device, device->failure());
  return false;
}

void StreamWorker::plan_if_overdue() {
  if (!state_->skipping.is_overdue() || state_->queue.counters().waiting_meshes == 0) return;
  const MutexLock lock(state_->meshes_mutex);
  if (state_->skipping.is_overdue())
    state_->plan(true);  // checked again: another thread may have planned
}

void StreamWorker::make_slice(const RequestPtr& request) {
  std::shared_ptr<SliceSamples> image;
  try {
    image = std::make_shared<SliceSamples>(read_slice(state_->bricks, request->slice(), *request));
  } catch (const OperationCancelled&) {
  } catch (const std::exception& e) {
    image = std::make_shared<SliceSamples>();
    image->request = request->slice();
    image->damage = e.what();
  }
  const bool accepted = state_->slices.put(*request, std::move(image));
  state_->queue.finish(request);
  if (accepted) state_->notify_change();
}

}  // namespace isobrick

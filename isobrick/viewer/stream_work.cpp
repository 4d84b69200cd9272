#include <algorithm>

#include "isobrick/core/error.h"
#include "isobrick/core/give_way.h"
#include "isobrick/core/stopwatch.h"
#include "isobrick/viewer/stream_state.h"

namespace isobrick {
namespace {

/// How much a job counts in the mean of those before.
constexpr double kWeightOfJob = 1.0 / 32;

/// Where a device has no room: the part of its budget that older meshes give back.
constexpr std::uint64_t kPartForNew = 8;

NodeMesh empty_mesh(const MeshJob& job) {
  NodeMesh mesh;
  mesh.key = job.key;
  mesh.isovalue = job.isovalue;
  mesh.coarser = job.coarser;
  return mesh;
}

}  // namespace

bool SceneStream::Shared::has_work() const {
  return (!jobs.empty() && !full) ||
         std::any_of(slots.begin(), slots.end(), [](const auto& s) { return s.second.wanted; });
}

bool SceneStream::Shared::idle() const { return !has_work() && running.empty(); }

std::shared_ptr<Running> SceneStream::Shared::take_slice() {
  for (auto& [number, slot] : slots)
    if (slot.wanted) {
      slot.running = std::make_shared<Running>(number, *slot.wanted);
      slot.wanted.reset();
      return slot.running;
    }
  return nullptr;
}

std::shared_ptr<Running> SceneStream::Shared::take(std::unique_lock<std::mutex>& lock) {
  work.wait(lock, [&] { return stop || has_work(); });
  if (stop) return nullptr;
  std::shared_ptr<Running> next = take_slice();
  if (!next) {
    next = std::make_shared<Running>(jobs.back());
    jobs.pop_back();
  }
  running.push_back(next);
  return next;
}

void SceneStream::Shared::publish(const Running& done, NodeMesh&& mesh) {
  ++counters.meshes_made;
  if (!mesh.damage.empty()) ++counters.damaged;
  triangles_made += mesh.triangles();
  blocks_made += static_cast<std::uint64_t>(tree->active_blocks(done.job.key, done.job.isovalue));
  meshes.put(std::make_shared<const NodeMesh>(std::move(mesh)));
  make_room();
  ++version;
}

void SceneStream::Shared::finish(const std::shared_ptr<Running>& r, bool changed,
                                 std::unique_lock<std::mutex>& lock) {
  std::erase(running, r);
  change.notify_all();
  if (!changed || !options.on_change || stop) return;
  ++calls;
  lock.unlock();
  options.on_change();
  lock.lock();
  --calls;
  change.notify_all();
}

void SceneStream::Shared::received(const std::shared_ptr<Running>& r, NodeMesh&& mesh,
                                   const std::string& failure, std::shared_ptr<DeviceMesher> by) {
  std::unique_lock lock(mutex);
  if (!stop && failure.empty()) {
    take_over(*r, std::move(mesh), *by);
  } else if (!stop) {
    give_up(by, failure);
    if (!r->abandoned) jobs.push_back(r->job);
    work.notify_one();
  } else {
    const NodeMesh dropped = std::move(mesh);  // not later, when nobody waits any more
  }
  // Before anybody hears of it: this is the device's thread, which should not be the last to hold
  // the device.
  by.reset();
  finish(r, !stop && failure.empty(), lock);
}

/// A mesh that a device has made.
void SceneStream::Shared::take_over(const Running& done, NodeMesh&& mesh, const DeviceMesher& by) {
  ++counters.device_meshes_made;
  // What came here for want of room there has to be uploaded: older ones make room instead, once
  // for all that came so. The budget itself may never be reached, since places fall between.
  const std::uint64_t budget = meshes.device_budget(), part = budget / kPartForNew;
  if (!mesh.device && !mesh.empty() && !by.shared_blocks().empty() &&
      meshes.device_bytes() + part > budget) {
    keep_shown();
    meshes.shrink_device(part);
  }
  publish(done, std::move(mesh));
}

void SceneStream::Shared::give_up(const std::shared_ptr<DeviceMesher>& failed,
                                  const std::string& failure) {
  if (device != failed) return;
  device.reset();
  counters.device_failure = failure;
}

bool SceneStream::Shared::has_device() const {
  const std::lock_guard lock(mutex);
  return device != nullptr;
}

/// Without the lock. False where there is no device, or it has failed.
bool SceneStream::Shared::send(const GridView& grid, const std::shared_ptr<Running>& r) {
  std::unique_lock lock(mutex);
  std::shared_ptr<DeviceMesher> to = device;
  if (!to) return false;
  lock.unlock();
  r->sent = true;
  const bool taken = to->make(
      grid, empty_mesh(r->job),
      [shared = shared_from_this(), r, to](NodeMesh&& mesh, const std::string& failure) mutable {
        shared->received(r, std::move(mesh), failure, std::move(to));
      });
  if (taken) return true;
  r->sent = false;
  lock.lock();
  give_up(to, to->failure());
  return false;
}

/// Without the lock. What was made here; nothing when it was abandoned, or sent to a device.
std::optional<NodeMesh> SceneStream::Shared::mesh_of(NodeMesher& mesher,
                                                     const std::shared_ptr<Running>& r) {
  try {
    const auto read = [&](NodeMesher::Form form) {
      return mesher.grid(r->job.key, r->job.isovalue, r->job.coarser, *r, form);
    };
    GridView grid =
        read(has_device() ? NodeMesher::Form::stored_if_possible : NodeMesher::Form::values);
    r->check();
    // The device is asked for only now: a read that is held up keeps none.
    if (send(grid, r)) return std::nullopt;
    if (grid.stored.samples != nullptr) grid = read(NodeMesher::Form::values);
    return mesher.extract(grid, empty_mesh(r->job));
  } catch (const Abandoned&) {
    return std::nullopt;
  } catch (const std::exception& e) {
    NodeMesh damaged = empty_mesh(r->job);
    damaged.damage = e.what();
    return damaged;
  }
}

void SceneStream::Shared::make_mesh(NodeMesher& mesher, const std::shared_ptr<Running>& r,
                                    std::unique_lock<std::mutex>& lock) {
  // Those before it are taken by other threads at the same time.
  std::optional<MeshJob> next;
  if (jobs.size() >= threads.size()) next = jobs[jobs.size() - threads.size()];
  lock.unlock();
  try {
    if (next) mesher.will_need(next->key, next->isovalue, next->coarser);
  } catch (const Error&) {  // whoever reads it will say so
  }
  const double before = mesher.seconds();
  Stopwatch watch;
  std::optional<NodeMesh> mesh = mesh_of(mesher, r);
  const double seconds = watch.lap();
  lock.lock();
  counters.mesh_seconds += mesher.seconds() - before;
  if (mesh || r->sent) seconds_per_job += (seconds - seconds_per_job) * kWeightOfJob;
  if (straight_until && Shared::Clock::now() > *straight_until && !jobs.empty() && !stop) {
    plan(true);
    work.notify_all();
  }
  if (r->sent) return;  // received() finishes it, perhaps has already
  const bool made = mesh.has_value() && !stop;
  if (made) publish(*r, std::move(*mesh));
  finish(r, made, lock);
}

void SceneStream::Shared::make_slice(const std::shared_ptr<Running>& r,
                                     std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  std::shared_ptr<SliceSamples> image;
  try {
    image = std::make_shared<SliceSamples>(read_slice(bricks, r->request, *r));
  } catch (const Abandoned&) {
  } catch (const std::exception& e) {
    image = std::make_shared<SliceSamples>();
    image->request = r->request;
    image->damage = e.what();
  }
  lock.lock();
  Slot& slot = slots[*r->slot];
  const bool wanted = slot.running == r;
  if (wanted) {
    slot.running.reset();
    if (image) slot.image = std::move(image);
  }
  finish(r, wanted, lock);
}

void SceneStream::Shared::run() {
  if (options.give_way) isobrick::give_way();
  NodeMesher mesher(tree->grid(), bricks, options.origin, options.inside);
  std::unique_lock lock(mutex);
  while (const std::shared_ptr<Running> r = take(lock)) {
    if (r->slot)
      make_slice(r, lock);
    else
      make_mesh(mesher, r, lock);
  }
  --alive;
  change.notify_all();
}

}  // namespace isobrick

#include "viewer/scene/scene_stream.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/thread_priority.h"
#include "viewer/scene/stream_state.h"
#include "viewer/scene/stream_worker.h"

namespace isobrick::inline v0 {
namespace {

/// How long the destructor waits for blocked threads and for a device.
constexpr std::chrono::milliseconds kCloseTimeout{50};

void run_worker(const std::shared_ptr<StreamState>& state) {
  if (state->options.lower_thread_priority) lower_thread_priority();
  StreamWorker(state).run();
  state->workers.end();
}

}  // namespace

SceneStream::SceneStream(std::shared_ptr<const BrickSource> source,
                         std::shared_ptr<const NodeTree> tree, StreamOptions options)
    : state_(
          std::make_shared<StreamState>(std::move(source), std::move(tree), std::move(options))) {
  for (int i = 0; i < state_->threads; ++i) {
    state_->workers.begin();
    threads_.emplace_back([state = state_] { run_worker(state); });
  }
}

SceneStream::~SceneStream() {
  state_->queue.close();
  state_->notifications.close();
  const auto deadline = std::chrono::steady_clock::now() + kCloseTimeout;
  const bool ended = state_->workers.wait_for_none(deadline);
  state_->queue.wait_until_unused(deadline);
  state_->notifications.wait_for_none(deadline);
  // Meshes that arrive later are dropped: an OpenGL context may be gone by then.
  {
    const MutexLock lock(state_->meshes_mutex);
    state_->meshes.close();
  }
  state_->slices.clear();
  state_->device.set(nullptr);
  state_->bricks.close();
  for (std::thread& thread : threads_)
    if (ended)
      thread.join();
    else
      thread.detach();
}

void SceneStream::set_cut(const Cut& cut) {
  CutIndex index(cut);
  const MutexLock lock(state_->meshes_mutex);
  if (state_->meshes.cut().isovalues != cut.isovalues) state_->skipping.isovalue_changed();
  state_->meshes.set_cut(cut, std::move(index));
  state_->plan(false);
}

std::shared_ptr<const Drawable> SceneStream::drawable() {
  const MutexLock lock(state_->meshes_mutex);
  auto drawable = state_->meshes.drawable();
  state_->pause_if_full();
  return drawable;
}

bool SceneStream::is_newest(const Drawable& drawable) const {
  const MutexLock lock(state_->meshes_mutex);
  return state_->meshes.is_newest(drawable);
}

void SceneStream::set_device(std::shared_ptr<DeviceMesher> device) {
  state_->device.set(std::move(device));
}

void SceneStream::set_device_budget(std::uint64_t bytes) {
  const MutexLock lock(state_->meshes_mutex);
  state_->meshes.set_device_budget(bytes);
  state_->pause_if_full();
}

void SceneStream::set_slice(int slot, const std::optional<SliceRequest>& request) {
  state_->slices.set(slot, request);
}

std::shared_ptr<const SliceSamples> SceneStream::slice(int slot) const {
  return state_->slices.image(slot);
}

bool SceneStream::idle() const { return state_->queue.idle(); }

bool SceneStream::wait_idle(double seconds) const { return state_->queue.wait_idle(seconds); }

StreamCounters SceneStream::counters() const {
  const ResidentBricks::Counters bricks = state_->bricks.counters();
  const BrickTimes times = state_->source->times();
  const MeshStatistics::Totals made = state_->statistics.totals();
  const RequestQueue::Counters queue = state_->queue.counters();
  StreamCounters c;
  c.read_seconds = times.read_seconds;
  c.decode_seconds = times.decode_seconds;
  c.mesh_seconds = made.seconds;
  c.bytes_read = times.bytes_read;
  c.bricks_resident = bricks.bricks;
  c.brick_bytes = bricks.bytes;
  c.brick_bytes_peak = bricks.peak_bytes;
  c.bricks_read = bricks.reads;
  c.meshes_made = made.meshes;
  c.queue = queue.waiting_meshes;
  c.working = queue.running;
  c.damaged = made.damaged;
  c.device_meshes_made = made.by_device;
  c.device_failure = state_->device.failure();
  c.triangles_made = made.triangles;
  c.blocks_made = made.blocks;
  c.triangles_per_block = made.triangles_per_block();
  c.mesh_budget_full = queue.stalled;
  const MutexLock lock(state_->meshes_mutex);
  c.meshes = state_->meshes.meshes();
  c.mesh_bytes = state_->meshes.bytes();
  c.device_bytes = state_->meshes.device_bytes();
  return c;
}

std::uint64_t SceneStream::missing_bricks() const {
  std::vector<StoredBrick> missing;
  for (const MeshJob& job : state_->queue.waiting_meshes())
    state_->planner.add_missing(job.key, job.isovalue, job.coarser, missing);
  std::sort(missing.begin(), missing.end());
  return static_cast<std::uint64_t>(std::unique(missing.begin(), missing.end()) - missing.begin());
}

ResidentBricks& SceneStream::bricks() const { return state_->bricks; }

}  // namespace isobrick

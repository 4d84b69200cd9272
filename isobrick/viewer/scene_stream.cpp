#include "isobrick/viewer/scene_stream.h"

#include <algorithm>

#include "isobrick/viewer/stream_state.h"

namespace isobrick {
namespace {

/// How long the destructor waits for threads that are held up and for a device.
constexpr std::chrono::milliseconds kPatience{50};

/// Meshes that come within this time need no coarser ones in their place, but for the coarsest of
/// all; those that have not come by then do.
constexpr std::chrono::duration<double> kSoon{0.1};
constexpr std::chrono::milliseconds kLate{300};

/// An isovalue that changes again within this time is being slid.
constexpr std::chrono::milliseconds kSliding{300};

/// From so many on the triangles of a block are told: a few coarse meshes are not like the rest.
constexpr std::uint64_t kMeasuredBlocks = 512;

int thread_count(int asked) {
  if (asked > 0) return asked;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
}

}  // namespace

void SceneStream::Shared::plan(bool late) {
  meshes.begin_use();
  bricks.forget_needs();
  const bool sliding = changed_twice && Clock::now() - *last_isovalue < kSliding;
  const double soon =
      late || sliding ? 0 : kSoon.count() / seconds_per_job * static_cast<double>(threads.size());
  MeshPlan next = plan_jobs(*tree, cut, meshes, planner, soon);
  if (!next.straight || next.jobs.empty())
    straight_until.reset();
  else if (!straight_until)
    straight_until = Clock::now() + kLate;
  std::vector<MeshJob> wanted = std::move(next.jobs);
  for (const auto& r : running) {
    if (r->slot) continue;
    const auto same = [&](const MeshJob& job) { return job.same_mesh(r->job); };
    const auto found = std::find_if(wanted.begin(), wanted.end(), same);
    if (found == wanted.end()) {
      r->abandoned = true;
    } else if (!r->abandoned || r->sent) {
      r->abandoned = false;  // what was sent comes anyway, and is wanted again
      wanted.erase(found);
    }
  }
  std::reverse(wanted.begin(), wanted.end());
  jobs = std::move(wanted);
  make_room();
}

/// What is shown takes room, too, whatever is wanted now.
void SceneStream::Shared::keep_shown() {
  for (const auto& place : shown)
    for (const DrawnNode& node : place)
      meshes.find(node.mesh->key, node.mesh->isovalue, node.mesh->coarser);
}

void SceneStream::Shared::make_room() {
  full = false;
  if (!meshes.keeps_budgets()) {
    keep_shown();
    full = !meshes.shrink();
  }
  counters.mesh_budget_full = full && !jobs.empty();
}

/// Shows the isovalue that a place shows already, as this cut wants it.
void SceneStream::Shared::show_before(std::size_t place) {
  std::vector<DrawnNode> nodes;
  bool complete = true;
  if (append_drawable(*tree, *index, shown[place].front().mesh->isovalue, static_cast<int>(place),
                      meshes, nodes, complete))
    shown[place] = std::move(nodes);
}

void SceneStream::Shared::rebuild_drawable() {
  auto next = std::make_shared<Drawable>();
  next->version = version;
  next->complete = next->covers = true;
  next->isovalues = cut.isovalues;
  meshes.begin_use();
  shown.resize(cut.isovalues.size());
  for (std::size_t i = 0; index && i < cut.isovalues.size(); ++i) {
    std::vector<DrawnNode> nodes;
    const bool covers = append_drawable(*tree, *index, cut.isovalues[i], static_cast<int>(i),
                                        meshes, nodes, next->complete);
    next->complete &= covers;
    next->covers &= covers;
    // The isovalue before is shown for as long as the new one has holes.
    const bool old = !shown[i].empty() && shown[i].front().mesh->isovalue != cut.isovalues[i];
    if (covers || !old)
      shown[i] = std::move(nodes);
    else
      show_before(i);
    next->nodes.insert(next->nodes.end(), shown[i].begin(), shown[i].end());
  }
  for (const DrawnNode& node : next->nodes) next->triangles += node.mesh->triangles();
  drawn = std::move(next);
  drawn_version = version;
  const bool was_full = full;
  make_room();
  if (was_full && !full) work.notify_all();
}

SceneStream::SceneStream(std::shared_ptr<const BrickSource> source,
                         std::shared_ptr<const NodeTree> tree, StreamOptions options)
    : shared_(std::make_shared<Shared>(std::move(source), std::move(tree), std::move(options))) {
  const int count = thread_count(shared_->options.threads);
  const std::lock_guard lock(shared_->mutex);
  for (; shared_->alive < count; ++shared_->alive)
    shared_->threads.emplace_back([shared = shared_] { shared->run(); });
}

SceneStream::~SceneStream() {
  std::unique_lock lock(shared_->mutex);
  shared_->stop = true;
  for (const auto& r : shared_->running) r->abandoned = true;
  shared_->work.notify_all();
  shared_->change.wait_for(lock, kPatience, [&] {
    return shared_->alive == 0 && shared_->calls == 0 && shared_->running.empty();
  });
  const bool ended = shared_->alive == 0;
  std::vector<std::thread> threads = std::move(shared_->threads);
  // Whoever comes later finds nothing, and keeps nothing: contexts may be gone by then.
  const auto meshes = std::exchange(shared_->meshes, MeshCache(0, 0));
  const auto shown = std::exchange(shared_->shown, {});
  const auto drawn = std::exchange(shared_->drawn, nullptr);
  const auto device = std::exchange(shared_->device, nullptr);
  const auto slots = std::exchange(shared_->slots, {});
  lock.unlock();
  shared_->bricks.close();
  for (std::thread& thread : threads)
    if (ended)
      thread.join();
    else
      thread.detach();
}

void SceneStream::set_cut(const Cut& cut) {
  CutIndex index(cut);
  const std::lock_guard lock(shared_->mutex);
  // An isovalue that moves on with every picture must not leave what was shown before the
  // first one: the last that covers stays.
  if (shared_->cut.isovalues != cut.isovalues) {
    if (!shared_->drawn || shared_->drawn_version != shared_->version) shared_->rebuild_drawable();
    const auto now = Shared::Clock::now();
    shared_->changed_twice = shared_->last_isovalue && now - *shared_->last_isovalue < kSliding;
    shared_->last_isovalue = now;
    shared_->straight_until.reset();
  }
  shared_->cut = cut;
  shared_->index.emplace(std::move(index));
  shared_->plan();
  ++shared_->version;
  shared_->work.notify_all();
  shared_->change.notify_all();
}

std::shared_ptr<const Drawable> SceneStream::drawable() {
  const std::lock_guard lock(shared_->mutex);
  if (!shared_->drawn || shared_->drawn_version != shared_->version) shared_->rebuild_drawable();
  return shared_->drawn;
}

void SceneStream::set_device(std::shared_ptr<DeviceMesher> device) {
  const std::lock_guard lock(shared_->mutex);
  shared_->counters.device_failure = device ? device->failure() : std::string();
  if (!shared_->counters.device_failure.empty()) device.reset();
  shared_->device = std::move(device);
}

void SceneStream::set_device_budget(std::uint64_t bytes) {
  const std::lock_guard lock(shared_->mutex);
  shared_->meshes.set_device_budget(bytes);
  const bool was_full = shared_->full;
  shared_->make_room();
  if (was_full && !shared_->full) shared_->work.notify_all();
}

void SceneStream::set_slice(int slot, const std::optional<SliceRequest>& request) {
  const std::lock_guard lock(shared_->mutex);
  Slot& place = shared_->slots[slot];
  const bool running = place.running && request && place.running->request == *request;
  const bool there = place.image && request && place.image->request == *request;
  if (place.running && !running) {
    place.running->abandoned = true;
    place.running.reset();
  }
  place.wanted.reset();
  if (!request)
    place.image.reset();
  else if (!running && !there)
    place.wanted = request;
  if (place.wanted) shared_->work.notify_one();
}

std::shared_ptr<const SliceSamples> SceneStream::slice(int slot) const {
  const std::lock_guard lock(shared_->mutex);
  const auto found = shared_->slots.find(slot);
  return found == shared_->slots.end() ? nullptr : found->second.image;
}

bool SceneStream::is_newest(const Drawable& drawable) const {
  const std::lock_guard lock(shared_->mutex);
  return drawable.version == shared_->version;
}

bool SceneStream::idle() const {
  const std::lock_guard lock(shared_->mutex);
  return shared_->idle();
}

bool SceneStream::wait_idle(double seconds) const {
  std::unique_lock lock(shared_->mutex);
  return shared_->change.wait_for(lock, std::chrono::duration<double>(seconds),
                                  [&] { return shared_->idle(); });
}

StreamCounters SceneStream::counters() const {
  const ResidentBricks::Counters bricks = shared_->bricks.counters();
  const BrickTimes times = shared_->source->times();
  const std::lock_guard lock(shared_->mutex);
  StreamCounters c = shared_->counters;
  c.read_seconds = times.read_seconds;
  c.decode_seconds = times.decode_seconds;
  c.bytes_read = times.bytes_read;
  c.bricks_resident = bricks.bricks;
  c.brick_bytes = bricks.bytes;
  c.brick_bytes_peak = bricks.peak_bytes;
  c.bricks_read = bricks.reads;
  c.meshes = shared_->meshes.meshes();
  c.mesh_bytes = shared_->meshes.bytes();
  c.device_bytes = shared_->meshes.device_bytes();
  c.queue = shared_->jobs.size();
  c.working = shared_->running.size();
  c.triangles_made = shared_->triangles_made;
  c.blocks_made = shared_->blocks_made;
  if (shared_->blocks_made >= kMeasuredBlocks)
    c.triangles_per_block =
        static_cast<double>(shared_->triangles_made) / static_cast<double>(shared_->blocks_made);
  return c;
}

std::uint64_t SceneStream::bricks_wanted() const {
  std::vector<MeshJob> jobs;
  {
    const std::lock_guard lock(shared_->mutex);
    jobs = shared_->jobs;
  }
  // Workers take jobs meanwhile: nothing that they change is asked.
  std::vector<StoredBrick> missing;
  for (const MeshJob& job : jobs)
    shared_->planner.add_missing(job.key, job.isovalue, job.coarser, missing);
  std::sort(missing.begin(), missing.end());
  return static_cast<std::uint64_t>(std::unique(missing.begin(), missing.end()) - missing.begin());
}

ResidentBricks& SceneStream::bricks() const { return shared_->bricks; }

}  // namespace isobrick

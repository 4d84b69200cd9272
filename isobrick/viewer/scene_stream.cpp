#include "isobrick/viewer/scene_stream.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <unordered_set>
#include <utility>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/viewer/stream_plan.h"

namespace isobrick {
namespace {

/// How long the destructor waits for threads that are held up.
constexpr std::chrono::milliseconds kPatience{50};

int thread_count(int asked) {
  if (asked > 0) return asked;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
}

/// Work that a thread is at: a mesh, or the slice of a place.
class Running final : public Wanted {
 public:
  explicit Running(MeshJob j) : job(std::move(j)) {}
  Running(int place, const SliceRequest& r) : slot(place), request(r) {}
  void check() const override {
    if (abandoned.load(std::memory_order_relaxed)) throw Abandoned();
  }
  MeshJob job;
  std::optional<int> slot;
  SliceRequest request;
  std::atomic<bool> abandoned = false;
  bool by_device = false;
};

/// A place for a slice.
struct Slot {
  std::optional<SliceRequest> wanted;  ///< and not yet being read
  std::shared_ptr<Running> running;
  std::shared_ptr<const SliceSamples> image;
};

}  // namespace

/// Outlives the stream for as long as a thread is held up in a read.
struct SceneStream::Shared {
  std::shared_ptr<const BrickSource> source;
  std::shared_ptr<const NodeTree> tree;
  StreamOptions options;
  ResidentBricks bricks;
  NodeMesher planner;  ///< only asked what it needs

  mutable std::mutex mutex;
  std::condition_variable work;
  mutable std::condition_variable change;
  bool stop = false;
  int alive = 0;
  std::vector<std::thread> threads;

  Cut cut;
  std::optional<CutIndex> index;
  std::vector<MeshJob> jobs;  ///< the most urgent last
  std::vector<std::shared_ptr<Running>> running;
  std::shared_ptr<DeviceMesher> device;
  MeshCache meshes;
  bool full = false;
  std::uint64_t version = 0;
  std::shared_ptr<const Drawable> drawn;  ///< null: out of date
  std::uint64_t drawn_version = 0;
  std::map<int, Slot> slots;
  StreamCounters counters;
  std::uint64_t triangles_made = 0, blocks_made = 0;
  std::vector<std::vector<DrawnNode>> shown;  ///< what each isovalue's place shows

  Shared(std::shared_ptr<const BrickSource> s, std::shared_ptr<const NodeTree> t, StreamOptions o)
      : source(std::move(s)),
        tree(std::move(t)),
        options(std::move(o)),
        bricks(source, options.brick_bytes),
        planner(tree->grid(), bricks, options.origin),
        meshes(options.mesh_bytes, options.device_bytes) {}

  void plan();
  void run();
  std::shared_ptr<Running> take(std::unique_lock<std::mutex>& lock);
  std::shared_ptr<Running> take_slice();
  bool has_work() const;
  bool idle() const;
  bool make_mesh(NodeMesher& mesher, const Running& r, const std::optional<MeshJob>& next,
                 std::unique_lock<std::mutex>& lock);
  bool make_slice(const std::shared_ptr<Running>& r, std::unique_lock<std::mutex>& lock);
  void follow_device(NodeMesher& mesher, std::shared_ptr<DeviceMesher>& used,
                     std::unique_lock<std::mutex>& lock);
  void publish(const Running& done, NodeMesh&& mesh, double seconds);
  void make_room();
  void count_wanted();
  void rebuild_drawable();
  void show_before(std::size_t place);
};

/// Needs the lock. Abandons what is not wanted any more.
void SceneStream::Shared::plan() {
  meshes.begin_use();
  std::vector<MeshJob> wanted = plan_jobs(*tree, cut, meshes, bricks, planner);
  for (const auto& r : running) {
    if (r->slot) continue;
    const auto same = [&](const MeshJob& job) { return job.same_mesh(r->job); };
    const auto found = std::find_if(wanted.begin(), wanted.end(), same);
    if (found == wanted.end())
      r->abandoned = true;
    else if (!r->abandoned)
      wanted.erase(found);
  }
  std::reverse(wanted.begin(), wanted.end());
  jobs = std::move(wanted);
  make_room();
  count_wanted();
}

void SceneStream::Shared::count_wanted() {
  std::unordered_set<NodeKey, NodeKeyHash> missing;
  for (const MeshJob& job : jobs) {
    if (job.resident) continue;
    const NodeMesher::Needs needs = planner.needs(job.key);
    for_each_point(needs.bricks, [&](Int3 b) {
      if (!bricks.resident(needs.stored, {b, b + Int3{1, 1, 1}})) missing.insert({needs.stored, b});
    });
  }
  counters.bricks_wanted = missing.size();
}

/// Needs the lock.
void SceneStream::Shared::make_room() {
  full = !meshes.shrink();
  counters.mesh_budget_full = full && !jobs.empty();
}

bool SceneStream::Shared::has_work() const {
  return (!jobs.empty() && !full) ||
         std::any_of(slots.begin(), slots.end(), [](const auto& s) { return s.second.wanted; });
}

/// Needs the lock.
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

void SceneStream::Shared::publish(const Running& done, NodeMesh&& mesh, double seconds) {
  counters.mesh_seconds += seconds;
  ++counters.meshes_made;
  if (done.by_device) ++counters.device_meshes_made;
  if (!mesh.damage.empty()) ++counters.damaged;
  triangles_made += mesh.triangles();
  blocks_made += static_cast<std::uint64_t>(tree->active_blocks(done.job.key, done.job.isovalue));
  meshes.put(std::make_shared<const NodeMesh>(std::move(mesh)));
  make_room();
  ++version;
}

/// Gives the lock up meanwhile. False when it was abandoned.
bool SceneStream::Shared::make_mesh(NodeMesher& mesher, const Running& r,
                                    const std::optional<MeshJob>& next,
                                    std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  const double before = mesher.seconds();
  std::optional<NodeMesh> mesh;
  try {
    if (next) {
      const NodeMesher::Needs needs = mesher.needs(next->key);
      bricks.will_need(needs.stored, needs.bricks);
    }
  } catch (const Error&) {  // whoever reads it will say so
  }
  try {
    mesh = mesher.mesh(r.job.key, r.job.isovalue, r.job.coarser, r);
  } catch (const Abandoned&) {
  } catch (const std::exception& e) {
    mesh.emplace();
    mesh->key = r.job.key;
    mesh->isovalue = r.job.isovalue;
    mesh->coarser = r.job.coarser;
    mesh->damage = e.what();
  }
  lock.lock();
  if (mesh) publish(r, std::move(*mesh), mesher.seconds() - before);
  return mesh.has_value();
}

/// Gives the lock up meanwhile. False when it was abandoned.
bool SceneStream::Shared::make_slice(const std::shared_ptr<Running>& r,
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
  if (slot.running != r) return false;
  slot.running.reset();
  if (image) slot.image = std::move(image);
  return true;
}

/// Gives the lock up meanwhile: setting a device up takes its time.
void SceneStream::Shared::follow_device(NodeMesher& mesher, std::shared_ptr<DeviceMesher>& used,
                                        std::unique_lock<std::mutex>& lock) {
  used = device;
  lock.unlock();
  std::string failure;
  try {
    mesher.set_worker(used ? used->worker() : nullptr);
  } catch (const Error& e) {
    mesher.set_worker(nullptr);
    failure = e.what();
  }
  lock.lock();
  if (failure.empty()) return;
  counters.device_failure = failure;
  if (used == device) device.reset();
  used.reset();
}

void SceneStream::Shared::run() {
  NodeMesher mesher(tree->grid(), bricks, options.origin);
  std::shared_ptr<DeviceMesher> used;
  std::unique_lock lock(mutex);
  while (const std::shared_ptr<Running> r = take(lock)) {
    if (used != device) follow_device(mesher, used, lock);
    r->by_device = used != nullptr;
    std::optional<MeshJob> next;
    if (!jobs.empty()) next = jobs.back();
    const bool done = r->slot ? make_slice(r, lock) : make_mesh(mesher, *r, next, lock);
    if (!mesher.failure().empty() && used == device) {
      counters.device_failure = mesher.failure();
      device.reset();
    }
    std::erase(running, r);
    change.notify_all();
    if (done && options.on_change && !stop) {
      lock.unlock();
      options.on_change();
      lock.lock();
    }
  }
  --alive;
  change.notify_all();
}

/// Needs the lock. Shows the isovalue that a place shows already, as this cut wants it.
void SceneStream::Shared::show_before(std::size_t place) {
  std::vector<DrawnNode> nodes;
  bool complete = true;
  if (append_drawable(*tree, *index, shown[place].front().mesh->isovalue, static_cast<int>(place),
                      meshes, nodes, complete))
    shown[place] = std::move(nodes);
}

/// Needs the lock.
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
  // What the cut still waits for is kept as well.
  for (const CutNode& node : cut.nodes)
    for (const double isovalue : cut.isovalues) meshes.find(node.key, isovalue, node.coarser);
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
  const bool ended = shared_->change.wait_for(lock, kPatience, [&] { return shared_->alive == 0; });
  std::vector<std::thread> threads = std::move(shared_->threads);
  lock.unlock();
  for (std::thread& thread : threads)
    if (ended)
      thread.join();
    else
      thread.detach();
}

void SceneStream::set_cut(const Cut& cut) {
  CutIndex index(shared_->tree->grid(), cut);
  const std::lock_guard lock(shared_->mutex);
  // An isovalue that moves on with every picture must not leave what was shown before the
  // first one: the last that covers stays.
  if (shared_->cut.isovalues != cut.isovalues) shared_->rebuild_drawable();
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
  shared_->device = std::move(device);
  shared_->counters.device_failure.clear();
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
  if (shared_->blocks_made > 0)
    c.triangles_per_block =
        static_cast<double>(shared_->triangles_made) / static_cast<double>(shared_->blocks_made);
  return c;
}

ResidentBricks& SceneStream::bricks() const { return shared_->bricks; }

}  // namespace isobrick

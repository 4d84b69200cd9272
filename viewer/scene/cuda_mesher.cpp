#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "core/thread_annotations.h"
#include "gpu/grid/grid_batch.h"
#include "gpu/grid/mesh_memory.h"
#include "viewer/scene/device_mesher.h"

namespace isobrick {
namespace {

/// Grids that are being made or wait for it: while one half is on the device threads fill the
/// other one.
constexpr int kSlots = 16;

DeviceBlock block_of(std::shared_ptr<const gpu::SharedMeshBlock> block) {
  return {block->file, block->bytes, block->vertices, block->triangles, block};
}

class SharedMesh final : public DeviceMesh {
 public:
  explicit SharedMesh(gpu::MeshSlice&& slice) : slice_(std::move(slice)) {
    const MeshRange& range = slice_.range();
    block = block_of(slice_.block());
    first_vertex = range.first_vertex;
    vertices = range.vertices;
    first_triangle = range.first_triangle;
    triangles = range.triangles;
  }

 private:
  gpu::MeshSlice slice_;
};

/// A grid that was taken.
struct Job {
  int slot;
  NodeMesh mesh;
  DeviceMesher::Done done;
  std::optional<gpu::MeshSlice> room;

  gpu::GridMeshJob on_device() const { return {slot, room ? room->place() : gpu::GridMeshPlace{}}; }
};

/// What the device's thread works with. It outlives the mesher while that thread does.
class Work {
 public:
  Work(int index, std::string device_name, std::shared_ptr<gpu::MeshMemory> shared)
      : device(index),
        name(std::move(device_name)),
        memory(std::move(shared)),
        batch_(index, kSlots) {
    for (int i = 0; i < kSlots; ++i) free_.push_back(i);
  }

  bool take(const GridView& grid, NodeMesh&& mesh, DeviceMesher::Done&& done);
  /// Until end(), and until all that was taken is done.
  void run();
  void end();
  DeviceMesher::Times times();
  std::string failure();

  const int device;
  const std::string name;
  const std::shared_ptr<gpu::MeshMemory> memory;  ///< null: meshes go through host memory
  TicketLock kernel_lock;

 private:
  std::optional<gpu::MeshSlice> room_for(std::uint32_t vertices, std::uint32_t triangles) const;
  void make(std::vector<Job>& jobs, DeviceMesher::Times& now);
  void add(const DeviceMesher::Times& now);
  std::optional<int> free_slot();
  std::vector<Job> next_jobs();
  void free_slots(const std::vector<Job>& jobs, const std::string& failure);
  void write_again(std::vector<Job*>& jobs);
  void learn(const gpu::GridMeshSize& size);

  gpu::GridBatch batch_;
  /// Room that is taken for a mesh whose size is not known yet.
  std::uint32_t likely_vertices_ = 1u << 14, likely_triangles_ = 1u << 15;

  Mutex mutex_;
  CondVar freed_, taken_;
  std::vector<int> free_ ISOBRICK_GUARDED_BY(mutex_);  ///< slots
  std::vector<Job> jobs_ ISOBRICK_GUARDED_BY(mutex_);
  std::string failure_ ISOBRICK_GUARDED_BY(mutex_);  ///< empty: none
  bool end_ ISOBRICK_GUARDED_BY(mutex_) = false;
  DeviceMesher::Times times_ ISOBRICK_GUARDED_BY(mutex_);
};

DeviceMesher::Times Work::times() {
  const MutexLock lock(mutex_);
  return times_;
}

std::string Work::failure() {
  const MutexLock lock(mutex_);
  return failure_;
}

/// Waits for it; nothing once the device has failed.
std::optional<int> Work::free_slot() {
  const MutexLock lock(mutex_);
  while (failure_.empty() && free_.empty()) freed_.wait(mutex_);
  if (!failure_.empty()) return std::nullopt;
  const int slot = free_.back();
  free_.pop_back();
  return slot;
}

bool Work::take(const GridView& grid, NodeMesh&& mesh, DeviceMesher::Done&& done) {
  const std::optional<int> slot = free_slot();
  if (!slot) return false;
  batch_.stage(*slot, grid);
  {
    const MutexLock lock(mutex_);
    jobs_.push_back({*slot, std::move(mesh), std::move(done), {}});
  }
  taken_.notify_one();
  return true;
}

void Work::end() {
  {
    const MutexLock lock(mutex_);
    end_ = true;
  }
  taken_.notify_one();
}

/// Waits for them; none once all is done and the end has come.
std::vector<Job> Work::next_jobs() {
  const MutexLock lock(mutex_);
  while (!end_ && jobs_.empty()) taken_.wait(mutex_);
  return std::exchange(jobs_, {});
}

void Work::free_slots(const std::vector<Job>& jobs, const std::string& failure) {
  {
    const MutexLock lock(mutex_);
    failure_ = failure;
    for (const Job& job : jobs) free_.push_back(job.slot);
  }
  freed_.notify_all();
}

void Work::run() {
  std::string failure;
  try {
    gpu::open_device(device);
  } catch (const std::exception& e) {
    failure = e.what();
  }
  for (;;) {
    std::vector<Job> jobs = next_jobs();
    if (jobs.empty()) return;
    DeviceMesher::Times now{.launches = 1, .grids = jobs.size()};
    try {
      if (failure.empty()) make(jobs, now);
    } catch (const std::exception& e) {
      failure = e.what();
    }
    free_slots(jobs, failure);
    Stopwatch watch;
    for (Job& job : jobs) job.done(std::move(job.mesh), failure);
    jobs.clear();
    now.hand_out = watch.lap();
    add(now);
  }
}

void Work::add(const DeviceMesher::Times& now) {
  const MutexLock lock(mutex_);
  times_.launches += now.launches;
  times_.grids += now.grids;
  times_.turn += now.turn;
  times_.memory += now.memory;
  times_.device += now.device;
  times_.hand_out += now.hand_out;
}

std::optional<gpu::MeshSlice> Work::room_for(std::uint32_t vertices,
                                             std::uint32_t triangles) const {
  if (memory == nullptr) return std::nullopt;
  return memory->take(vertices, triangles);
}

void Work::learn(const gpu::GridMeshSize& size) {
  if (size.triangles == 0) return;
  likely_vertices_ = std::max(size.vertices + size.vertices / 4, likely_vertices_ / 8 * 7);
  likely_triangles_ = std::max(size.triangles + size.triangles / 4, likely_triangles_ / 8 * 7);
}

/// Room is taken for what meshes were like before, so that the device is waited for once.
void Work::make(std::vector<Job>& jobs, DeviceMesher::Times& now) {
  Stopwatch watch;
  std::vector<gpu::GridMeshJob> all;
  for (Job& job : jobs) {
    job.room = room_for(likely_vertices_, likely_triangles_);
    all.push_back(job.on_device());
  }
  now.memory = watch.lap();
  const TicketGuard guard(&kernel_lock);
  now.turn = watch.lap();
  batch_.make(all);
  std::vector<Job*> again;
  for (Job& job : jobs) {
    const gpu::GridMeshSize size = batch_.size(job.slot);
    learn(size);
    job.mesh.seam_triangles = size.seam_triangles;
    if (size.triangles == 0)
      job.room.reset();
    else if (job.room && job.room->place().holds(size.vertices, size.triangles))
      job.room->trim(size.vertices, size.triangles);
    else
      again.push_back(&job);
  }
  write_again(again);
  now.device = watch.lap();
  for (Job& job : jobs) {
    if (!job.room) continue;
    const MeshRange& range = job.room->range();
    job.mesh.device_triangles = range.triangles;
    job.mesh.device_bytes = range.vertices * 2 * sizeof(Vec3f) + range.triangles * sizeof(Triangle);
    job.mesh.device = std::make_shared<SharedMesh>(*std::exchange(job.room, std::nullopt));
  }
}

/// Those that did not fit: now their sizes are known.
void Work::write_again(std::vector<Job*>& jobs) {
  std::vector<gpu::GridMeshJob> placed;
  for (Job* job : jobs) job->room.reset();
  for (Job* job : jobs) {
    const gpu::GridMeshSize size = batch_.size(job->slot);
    job->room = room_for(size.vertices, size.triangles);
    if (job->room) placed.push_back(job->on_device());
  }
  batch_.write(placed);
  for (Job* job : jobs)
    if (!job->room) batch_.download(job->slot, job->mesh.mesh);
}

class CudaMesher final : public DeviceMesher {
 public:
  explicit CudaMesher(std::shared_ptr<Work> work)
      : work_(std::move(work)), thread_([w = work_] { w->run(); }) {}
  ~CudaMesher() override {
    work_->end();
    // The last one to hold it may be a mesh's receiver, in that thread.
    if (thread_.get_id() == std::this_thread::get_id())
      thread_.detach();
    else
      thread_.join();
  }

  bool make(const GridView& grid, NodeMesh mesh, Done done) override {
    return work_->take(grid, std::move(mesh), std::move(done));
  }
  std::string failure() const override { return work_->failure(); }
  const std::string& name() const override { return work_->name; }
  std::vector<DeviceBlock> shared_blocks() const override {
    std::vector<DeviceBlock> blocks;
    if (work_->memory)
      for (auto& block : work_->memory->blocks()) blocks.push_back(block_of(std::move(block)));
    return blocks;
  }
  Times times() const override { return work_->times(); }
  void share_only(std::size_t blocks) override {
    if (work_->memory) work_->memory->keep(blocks);
  }
  std::uint64_t bytes() const override { return work_->memory ? work_->memory->bytes() : 0; }
  TicketLock& kernel_lock() override { return work_->kernel_lock; }

 private:
  std::shared_ptr<Work> work_;
  std::thread thread_;
};

}  // namespace

std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>& drawing,
                                                 std::uint64_t budget) {
  const int count = gpu::device_count();
  if (count == 0) return nullptr;
  int device = 0;
  bool draws = false;
  for (int i = 0; drawing && i < count && !draws; ++i)
    if (gpu::device_id(i) == *drawing) {
      device = i;
      draws = true;
    }
  const gpu::DeviceInfo info = gpu::open_device(device);
  std::shared_ptr<gpu::MeshMemory> memory;
  if (draws) {
    try {
      // Half of what is free is for making meshes and for drawing them.
      memory = std::make_shared<gpu::MeshMemory>(device, std::min(budget, info.free_bytes / 2));
    } catch (const Error&) {  // through host memory, then
    }
  }
  return std::make_shared<CudaMesher>(std::make_shared<Work>(device, info.name, std::move(memory)));
}

}  // namespace isobrick

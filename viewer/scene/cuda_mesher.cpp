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

namespace isobrick::inline v0 {
namespace {

/// Slots for grids in flight: threads fill one half while the device works on the other.
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

/// A grid in a slot, and its mesh.
struct GridJob {
  int slot;
  NodeMesh mesh;
  DeviceMesher::Callback done;
  std::optional<gpu::MeshSlice> slice;

  gpu::GridMeshJob on_device() const {
    return {slot, slice ? slice->place() : gpu::GridMeshPlace{}};
  }
};

/// The state of the device's thread, which may outlive the mesher.
class DeviceWorker {
 public:
  DeviceWorker(int index, std::string device_name, std::shared_ptr<gpu::MeshMemory> shared)
      : device(index),
        name(std::move(device_name)),
        memory(std::move(shared)),
        batch_(index, kSlots) {
    for (int i = 0; i < kSlots; ++i) free_.push_back(i);
  }

  bool take(const GridView& grid, NodeMesh&& mesh, DeviceMesher::Callback&& done);
  /// Returns after end(), once all accepted grids are done.
  void run();
  void end();
  DeviceMesher::Times times();
  std::string failure();

  const int device;
  const std::string name;
  const std::shared_ptr<gpu::MeshMemory> memory;  ///< null: meshes go through host memory
  TicketLock kernel_lock;

 private:
  std::optional<gpu::MeshSlice> reserve_slice(std::uint32_t vertices,
                                              std::uint32_t triangles) const;
  void make(std::vector<GridJob>& jobs, DeviceMesher::Times& now);
  void add(const DeviceMesher::Times& now);
  std::optional<int> free_slot();
  std::vector<GridJob> next_jobs();
  void free_slots(const std::vector<GridJob>& jobs, const std::string& failure);
  void write_oversized(std::vector<GridJob*>& jobs);
  void update_expected(const gpu::GridMeshSize& size);

  gpu::GridBatch batch_;
  /// Space to reserve for a mesh of unknown size.
  std::uint32_t expected_vertices_ = 1u << 14, expected_triangles_ = 1u << 15;

  Mutex mutex_;
  CondVar freed_, taken_;
  std::vector<int> free_ ISOBRICK_GUARDED_BY(mutex_);  ///< slots
  std::vector<GridJob> jobs_ ISOBRICK_GUARDED_BY(mutex_);
  std::string failure_ ISOBRICK_GUARDED_BY(mutex_);  ///< empty: none
  bool end_ ISOBRICK_GUARDED_BY(mutex_) = false;
  DeviceMesher::Times times_ ISOBRICK_GUARDED_BY(mutex_);
};

DeviceMesher::Times DeviceWorker::times() {
  const MutexLock lock(mutex_);
  return times_;
}

std::string DeviceWorker::failure() {
  const MutexLock lock(mutex_);
  return failure_;
}

/// Waits for a free slot; nullopt once the device has failed.
std::optional<int> DeviceWorker::free_slot() {
  const MutexLock lock(mutex_);
  while (failure_.empty() && free_.empty()) freed_.wait(mutex_);
  if (!failure_.empty()) return std::nullopt;
  const int slot = free_.back();
  free_.pop_back();
  return slot;
}

bool DeviceWorker::take(const GridView& grid, NodeMesh&& mesh, DeviceMesher::Callback&& done) {
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

void DeviceWorker::end() {
  {
    const MutexLock lock(mutex_);
    end_ = true;
  }
  taken_.notify_one();
}

/// Waits for jobs; empty after end(), once all are done.
std::vector<GridJob> DeviceWorker::next_jobs() {
  const MutexLock lock(mutex_);
  while (!end_ && jobs_.empty()) taken_.wait(mutex_);
  return std::exchange(jobs_, {});
}

void DeviceWorker::free_slots(const std::vector<GridJob>& jobs, const std::string& failure) {
  {
    const MutexLock lock(mutex_);
    failure_ = failure;
    for (const GridJob& job : jobs) free_.push_back(job.slot);
  }
  freed_.notify_all();
}

void DeviceWorker::run() {
  std::string failure;
  try {
    gpu::open_device(device);
  } catch (const std::exception& e) {
    failure = e.what();
  }
  for (;;) {
    std::vector<GridJob> jobs = next_jobs();
    if (jobs.empty()) return;
    DeviceMesher::Times now{.launches = 1, .grids = jobs.size()};
    try {
      if (failure.empty()) make(jobs, now);
    } catch (const std::exception& e) {
      failure = e.what();
    }
    free_slots(jobs, failure);
    Stopwatch watch;
    for (GridJob& job : jobs) job.done(std::move(job.mesh), failure);
    jobs.clear();
    now.deliver = watch.lap();
    add(now);
  }
}

void DeviceWorker::add(const DeviceMesher::Times& now) {
  const MutexLock lock(mutex_);
  times_.launches += now.launches;
  times_.grids += now.grids;
  times_.lock += now.lock;
  times_.memory += now.memory;
  times_.device += now.device;
  times_.deliver += now.deliver;
}

std::optional<gpu::MeshSlice> DeviceWorker::reserve_slice(std::uint32_t vertices,
                                                          std::uint32_t triangles) const {
  if (memory == nullptr) return std::nullopt;
  return memory->take(vertices, triangles);
}

void DeviceWorker::update_expected(const gpu::GridMeshSize& size) {
  if (size.triangles == 0) return;
  expected_vertices_ = std::max(size.vertices + size.vertices / 4, expected_vertices_ / 8 * 7);
  expected_triangles_ = std::max(size.triangles + size.triangles / 4, expected_triangles_ / 8 * 7);
}

/// Reserves the expected space before the launch, so that the device is waited for only once.
void DeviceWorker::make(std::vector<GridJob>& jobs, DeviceMesher::Times& now) {
  Stopwatch watch;
  std::vector<gpu::GridMeshJob> all;
  for (GridJob& job : jobs) {
    job.slice = reserve_slice(expected_vertices_, expected_triangles_);
    all.push_back(job.on_device());
  }
  now.memory = watch.lap();
  const TicketGuard guard(&kernel_lock);
  now.lock = watch.lap();
  batch_.make(all);
  std::vector<GridJob*> oversized;
  for (GridJob& job : jobs) {
    const gpu::GridMeshSize size = batch_.size(job.slot);
    update_expected(size);
    job.mesh.seam_triangles = size.seam_triangles;
    if (size.triangles == 0)
      job.slice.reset();
    else if (job.slice && job.slice->place().holds(size.vertices, size.triangles))
      job.slice->trim(size.vertices, size.triangles);
    else
      oversized.push_back(&job);
  }
  write_oversized(oversized);
  now.device = watch.lap();
  for (GridJob& job : jobs) {
    if (!job.slice) continue;
    const MeshRange& range = job.slice->range();
    job.mesh.device_triangles = range.triangles;
    job.mesh.device_bytes = range.vertices * 2 * sizeof(Vec3f) + range.triangles * sizeof(Triangle);
    job.mesh.device = std::make_shared<SharedMesh>(*std::exchange(job.slice, std::nullopt));
  }
}

/// Writes the meshes that did not fit, now that their sizes are known.
void DeviceWorker::write_oversized(std::vector<GridJob*>& jobs) {
  std::vector<gpu::GridMeshJob> placed;
  for (GridJob* job : jobs) job->slice.reset();
  for (GridJob* job : jobs) {
    const gpu::GridMeshSize size = batch_.size(job->slot);
    job->slice = reserve_slice(size.vertices, size.triangles);
    if (job->slice) placed.push_back(job->on_device());
  }
  batch_.write(placed);
  for (GridJob* job : jobs)
    if (!job->slice) batch_.download(job->slot, job->mesh.mesh);
}

class CudaMesher final : public DeviceMesher {
 public:
  explicit CudaMesher(std::shared_ptr<DeviceWorker> worker)
      : worker_(std::move(worker)), thread_([w = worker_] { w->run(); }) {}
  ~CudaMesher() override {
    worker_->end();
    // The device's own thread may be the last owner, when it passes on a mesh.
    if (thread_.get_id() == std::this_thread::get_id())
      thread_.detach();
    else
      thread_.join();
  }

  bool make(const GridView& grid, NodeMesh mesh, Callback done) override {
    return worker_->take(grid, std::move(mesh), std::move(done));
  }
  std::string failure() const override { return worker_->failure(); }
  const std::string& name() const override { return worker_->name; }
  std::vector<DeviceBlock> shared_blocks() const override {
    std::vector<DeviceBlock> blocks;
    if (worker_->memory)
      for (auto& block : worker_->memory->blocks()) blocks.push_back(block_of(std::move(block)));
    return blocks;
  }
  Times times() const override { return worker_->times(); }
  void share_only(std::size_t blocks) override {
    if (worker_->memory) worker_->memory->keep(blocks);
  }
  std::uint64_t bytes() const override { return worker_->memory ? worker_->memory->bytes() : 0; }
  TicketLock& kernel_lock() override { return worker_->kernel_lock; }

 private:
  std::shared_ptr<DeviceWorker> worker_;
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
      // The other half of the free memory is for making and drawing meshes.
      memory = std::make_shared<gpu::MeshMemory>(device, std::min(budget, info.free_bytes / 2));
    } catch (const Error&) {  // meshes go through host memory
    }
  }
  return std::make_shared<CudaMesher>(
      std::make_shared<DeviceWorker>(device, info.name, std::move(memory)));
}

}  // namespace isobrick

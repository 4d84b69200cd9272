#include "viewer/scene/request_queue.h"

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {

bool RequestQueue::has_work() const { return (!meshes_.empty() && !paused_) || !slices_.empty(); }

bool RequestQueue::is_idle() const { return !has_work() && running_.empty(); }

void RequestQueue::replace_meshes(std::vector<MeshJob> meshes) {
  {
    const MutexLock lock(mutex_);
    if (closed_) return;
    for (const RequestPtr& running : running_) {
      if (running->is_slice()) continue;
      const auto found = std::find_if(meshes.begin(), meshes.end(), [&](const MeshJob& job) {
        return job.same_mesh(running->mesh());
      });
      if (found == meshes.end()) {
        running->set_cancelled(true);
      } else if (!running->cancelled() || running->sent_to_device()) {
        running->set_cancelled(false);  // a device makes the mesh in any case
        meshes.erase(found);
      }
    }
    std::reverse(meshes.begin(), meshes.end());
    meshes_ = std::move(meshes);
  }
  work_.notify_all();
  change_.notify_all();
}

void RequestQueue::pause_meshes(bool paused) {
  {
    const MutexLock lock(mutex_);
    if (std::exchange(paused_, paused) == paused) return;
  }
  (paused ? change_ : work_).notify_all();
}

void RequestQueue::add_slice(RequestPtr slice) {
  {
    const MutexLock lock(mutex_);
    if (closed_) return;
    const int slot = slice->slot();
    slices_[slot] = std::move(slice);
  }
  work_.notify_one();
}

void RequestQueue::cancel_slice(const StreamRequest& slice) {
  const MutexLock lock(mutex_);
  const auto waiting = slices_.find(slice.slot());
  if (waiting != slices_.end() && waiting->second.get() == &slice) slices_.erase(waiting);
  for (const RequestPtr& running : running_)
    if (running.get() == &slice) running->set_cancelled(true);
  change_.notify_all();
}

RequestQueue::RequestPtr RequestQueue::take() {
  const MutexLock lock(mutex_);
  while (!closed_ && !has_work()) work_.wait(mutex_);
  if (closed_) return nullptr;
  RequestPtr next;
  if (!slices_.empty()) {
    next = std::move(slices_.begin()->second);
    slices_.erase(slices_.begin());
  } else {
    next = std::make_shared<StreamRequest>(meshes_.back());
    meshes_.pop_back();
  }
  running_.push_back(next);
  return next;
}

void RequestQueue::finish(const RequestPtr& request) {
  {
    const MutexLock lock(mutex_);
    std::erase(running_, request);
  }
  change_.notify_all();
}

void RequestQueue::retry(const RequestPtr& request) {
  {
    const MutexLock lock(mutex_);
    std::erase(running_, request);
    if (!closed_ && !request->cancelled()) meshes_.push_back(request->mesh());
  }
  work_.notify_one();
  change_.notify_all();
}

std::optional<MeshJob> RequestQueue::mesh_after(std::size_t others) const {
  const MutexLock lock(mutex_);
  if (meshes_.size() <= others) return std::nullopt;
  return meshes_[meshes_.size() - 1 - others];
}

std::vector<MeshJob> RequestQueue::waiting_meshes() const {
  const MutexLock lock(mutex_);
  return meshes_;
}

bool RequestQueue::idle() const {
  const MutexLock lock(mutex_);
  return is_idle();
}

bool RequestQueue::wait_idle(double seconds) const {
  using Clock = std::chrono::steady_clock;
  const Time deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(seconds));
  const MutexLock lock(mutex_);
  while (!is_idle())
    if (!change_.wait_until(mutex_, deadline)) return is_idle();
  return true;
}

void RequestQueue::close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
    meshes_.clear();
    slices_.clear();
    for (const RequestPtr& running : running_) running->set_cancelled(true);
  }
  work_.notify_all();
  change_.notify_all();
}

bool RequestQueue::closed() const {
  const MutexLock lock(mutex_);
  return closed_;
}

bool RequestQueue::wait_until_unused(Time deadline) const {
  const MutexLock lock(mutex_);
  while (!running_.empty())
    if (!change_.wait_until(mutex_, deadline)) return running_.empty();
  return true;
}

RequestQueue::Counters RequestQueue::counters() const {
  const MutexLock lock(mutex_);
  return {meshes_.size(), running_.size(), paused_ && !meshes_.empty()};
}

}  // namespace isobrick

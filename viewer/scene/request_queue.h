#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/thread_annotations.h"
#include "viewer/scene/stream_request.h"

namespace isobrick {

/// The meshes and slices that threads are to make, by priority, and those that are being made.
/// Slices come before meshes. Thread-safe.
class RequestQueue {
 public:
  using RequestPtr = std::shared_ptr<StreamRequest>;
  using Time = std::chrono::steady_clock::time_point;

  /// Replaces the meshes that wait; the most urgent first. Those of them that are being made go on,
  /// and all others that are being made are cancelled.
  void replace_meshes(std::vector<MeshJob> meshes);
  /// While meshes are paused none is taken: there is no room for them.
  void pause_meshes(bool paused);
  /// Adds a slice in place of the one that waits for the same slot.
  void add_slice(RequestPtr slice);
  /// Cancels a slice that waits or is being made.
  void cancel_slice(const StreamRequest& slice);

  /// Waits for the most urgent request, which then is being made until finish() or retry(). Null
  /// once the queue is closed.
  RequestPtr take();
  void finish(const RequestPtr& request);
  /// The mesh could not be made: it waits again, before all others, unless it was cancelled.
  void retry(const RequestPtr& request);

  /// The mesh that comes after so many others; nothing where there are fewer.
  std::optional<MeshJob> mesh_after(std::size_t others) const;
  /// Those that wait.
  std::vector<MeshJob> waiting_meshes() const;

  /// Whether no request is being made, and none waits that may be taken.
  bool idle() const;
  /// Waits for that at most so long.
  bool wait_idle(double seconds) const;

  /// Cancels everything. From now on the queue takes and gives nothing.
  void close();
  bool closed() const;
  /// Waits until nothing is being made.
  bool wait_until_unused(Time deadline) const;

  struct Counters {
    std::size_t waiting_meshes = 0, running = 0;
    bool stalled = false;  ///< meshes wait, and are paused
  };
  Counters counters() const;

 private:
  bool has_work() const ISOBRICK_REQUIRES(mutex_);
  bool is_idle() const ISOBRICK_REQUIRES(mutex_);

  mutable Mutex mutex_;
  CondVar work_;
  mutable CondVar change_;
  bool closed_ ISOBRICK_GUARDED_BY(mutex_) = false;
  bool paused_ ISOBRICK_GUARDED_BY(mutex_) = false;
  std::vector<MeshJob> meshes_ ISOBRICK_GUARDED_BY(mutex_);       ///< the most urgent last
  std::map<int, RequestPtr> slices_ ISOBRICK_GUARDED_BY(mutex_);  ///< by slot
  std::vector<RequestPtr> running_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick

#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/thread_annotations.h"
#include "viewer/scene/stream_request.h"

namespace isobrick::inline v0 {

/// Requests for meshes and slices, by priority: those that wait, and those that threads are
/// running. Slices come before meshes. Thread-safe.
class RequestQueue {
 public:
  using RequestPtr = std::shared_ptr<StreamRequest>;
  using Time = std::chrono::steady_clock::time_point;

  /// Replaces the waiting meshes, the most urgent first. Running requests for one of them continue;
  /// all other running meshes are cancelled.
  void replace_meshes(std::vector<MeshJob> meshes);
  /// While paused, take() returns no meshes: there is no room for them.
  void pause_meshes(bool paused);
  /// Adds a slice; it replaces one that waits for the same slot.
  void add_slice(RequestPtr slice);
  /// Cancels a waiting or running slice.
  void cancel_slice(const StreamRequest& slice);

  /// Waits for the most urgent request and returns it. The request runs until finish() or retry().
  /// Returns null once the queue is closed.
  RequestPtr take();
  void finish(const RequestPtr& request);
  /// The mesh could not be made: puts it back, before all others, unless it was cancelled.
  void retry(const RequestPtr& request);

  /// The mesh with `others` waiting meshes before it; nullopt if there are fewer.
  std::optional<MeshJob> mesh_after(std::size_t others) const;
  std::vector<MeshJob> waiting_meshes() const;

  /// Whether no request runs, and none that take() may return waits.
  bool idle() const;
  /// Waits for idle() at most `seconds`; returns whether it holds.
  bool wait_idle(double seconds) const;

  /// Cancels everything. A closed queue accepts and returns no requests.
  void close();
  bool closed() const;
  /// Waits until no request runs; returns whether that holds.
  bool wait_until_unused(Time deadline) const;

  struct Counters {
    std::size_t waiting_meshes = 0, running = 0;
    bool stalled = false;  ///< meshes wait but are paused
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

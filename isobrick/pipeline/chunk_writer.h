#pragma once

#include <tbb/concurrent_queue.h>

#include <atomic>
#include <exception>
#include <memory>
#include <thread>

#include "isobrick/surface/surface_options.h"

namespace isobrick {

/// Hands mesh chunks to a sink on a thread of its own, so that writing overlaps
/// with making the next one. Two buffers go round; no more are ever made.
class ChunkWriter {
 public:
  explicit ChunkWriter(MeshSink& sink);
  /// Stops; what is queued is dropped unless finish() was called.
  ~ChunkWriter();

  /// Queues the buffer's mesh and puts an empty buffer in its place; waits while
  /// the chunk before is being written. Rethrows what the sink threw.
  void write(MeshBuffer& mesh, std::uint64_t first_vertex);
  /// Waits until all is written.
  void finish();
  /// Seconds that the sink was busy.
  double seconds() const { return seconds_; }

 private:
  struct Job {
    MeshBuffer mesh;
    std::uint64_t first_vertex = 0;
    bool last = false;
  };
  void run();
  MeshBuffer take_free();

  MeshSink& sink_;
  tbb::concurrent_bounded_queue<std::shared_ptr<Job>> jobs_;
  tbb::concurrent_bounded_queue<std::shared_ptr<MeshBuffer>> free_;
  std::atomic<bool> failed_{false};
  std::exception_ptr error_;
  std::atomic<double> seconds_{0};
  std::thread thread_;
};

}  // namespace isobrick

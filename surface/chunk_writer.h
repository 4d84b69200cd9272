#pragma once

#include <tbb/concurrent_queue.h>

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
#include <thread>

#include <isobrick/surface_options.h>
#include <isobrick/surface_report.h>

namespace isobrick::inline v0 {

/// Hands mesh chunks to a sink on a thread of its own, so that writing overlaps
/// with making the next one. Either two buffers go round, or the extractor lends
/// its own; either way nothing is copied.
class ChunkWriter {
 public:
  explicit ChunkWriter(MeshSink& sink);
  /// Stops; what is queued is dropped unless finish() was called.
  ~ChunkWriter();

  /// Queues the buffer's mesh and puts an empty buffer in its place; waits while
  /// the chunk before is being written. Rethrows what the sink threw.
  void write(Mesh& mesh, std::uint64_t first_vertex);
  /// Queues a chunk that stays as it is until `release` is called, on the writer's
  /// thread. Waits for nothing; rethrows what the sink threw, and does not take it then.
  void write(const MeshChunk& chunk, std::function<void()> release);
  /// Waits until all is written.
  void finish();
  /// How long the sink was busy, and the bytes of the mesh; after finish().
  StageReport report() const { return {seconds_, bytes_}; }

 private:
  struct Job {
    MeshChunk chunk;
    std::function<void()> release;
    bool last = false;
  };
  void run();
  Mesh take_free();
  void rethrow() const;

  MeshSink& sink_;
  tbb::concurrent_bounded_queue<std::shared_ptr<Job>> jobs_;
  tbb::concurrent_bounded_queue<std::shared_ptr<Mesh>> free_;
  std::atomic<bool> failed_{false};
  std::exception_ptr error_;
  double seconds_ = 0;       ///< of the thread
  std::uint64_t bytes_ = 0;  ///< of who writes
  std::thread thread_;
};

}  // namespace isobrick

#include "pipeline/extract/sink_writers.h"

#include <atomic>
#include <chrono>
#include <deque>
#include <exception>
#include <future>
#include <vector>

namespace isobrick::inline v0 {
namespace {

/// Ends a write because another one failed.
class WriteStopped final : public std::exception {};

/// Counts what another sink takes, and ends its write when `stop` is set.
class WatchedSink final : public MeshSink {
 public:
  WatchedSink(MeshSink& sink, const std::atomic<bool>& stop) : sink_(sink), stop_(stop) {}

  Indexing indexing() const override { return sink_.indexing(); }
  void begin(const MeshHeader& header) override { sink_.begin(header); }
  void write(const MeshChunk& chunk) override {
    if (stop_) throw WriteStopped();
    sink_.write(chunk);
    taken_ +=
        chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes();
  }
  void finish() override {
    if (stop_) throw WriteStopped();
    sink_.finish();
  }
  std::uint64_t bytes() const override { return sink_.bytes(); }
  std::uint64_t memory() const override { return sink_.memory(); }

  /// Bytes since the last call.
  std::uint64_t take_count() { return taken_.exchange(0); }

 private:
  MeshSink& sink_;
  const std::atomic<bool>& stop_;
  std::atomic<std::uint64_t> taken_ = 0;
};

struct StopAtExit {
  std::atomic<bool>& stop;
  ~StopAtExit() { stop = true; }
};

}  // namespace

void write_together(std::span<MeshSink* const> sinks,
                    const std::function<void(std::size_t, MeshSink&)>& write,
                    const std::function<void(std::size_t, std::uint64_t)>& written) {
  std::atomic<bool> stop = false;
  std::deque<WatchedSink> watched;
  for (MeshSink* sink : sinks) watched.emplace_back(*sink, stop);
  std::vector<std::future<void>> writers;
  const StopAtExit stop_at_exit{stop};  // before `writers` wait for their threads
  for (std::size_t i = 0; i < sinks.size(); ++i)
    writers.push_back(std::async(std::launch::async, [&, i] {
      try {
        write(i, watched[i]);
        watched[i].finish();
      } catch (...) {
        stop = true;
        throw;
      }
    }));
  const auto report = [&] {
    for (std::size_t i = 0; i < watched.size(); ++i) written(i, watched[i].take_count());
  };
  for (const std::future<void>& writer : writers)
    while (writer.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) report();
  std::exception_ptr failure;
  for (std::future<void>& writer : writers) try {
      writer.get();
    } catch (const WriteStopped&) {
      // The failure of another one.
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
  if (failure) std::rethrow_exception(failure);
  report();
}

}  // namespace isobrick

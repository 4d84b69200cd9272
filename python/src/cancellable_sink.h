#pragma once

#include <stop_token>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/mesh.h>

namespace isobrick::python {

/// Passes a mesh on to a slow sink, and throws Cancelled in place of it once a stop is requested.
class CancellableSink final : public MeshSink {
 public:
  /// `sink` must outlive it.
  CancellableSink(MeshSink& sink, std::stop_token cancel)
      : sink_(sink), cancel_(std::move(cancel)) {}

  Indexing indexing() const override { return sink_.indexing(); }
  void begin(const MeshHeader& header) override { sink_.begin(header); }
  void write(const MeshChunk& chunk) override {
    if (cancel_.stop_requested()) throw Cancelled("the operation was cancelled");
    sink_.write(chunk);
  }
  void finish() override { sink_.finish(); }
  std::uint64_t bytes() const override { return sink_.bytes(); }
  std::uint64_t memory() const override { return sink_.memory(); }

 private:
  MeshSink& sink_;
  std::stop_token cancel_;
};

}  // namespace isobrick::python

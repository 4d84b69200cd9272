#pragma once

#include <cstdint>
#include <stop_token>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/mesh.h>
#include "core/cancel.h"

namespace isobrick::inline v0 {

/// A filter between the extraction and a sink, which it writes to.
class FilterStage : public MeshSink {
 public:
  /// `next` must outlive it.
  FilterStage(MeshSink& next, std::stop_token cancel) : next_(next), cancel_(std::move(cancel)) {}

  Indexing indexing() const override { return Indexing::welded; }
  std::uint64_t bytes() const override { return own_bytes() + next_.bytes(); }
  std::uint64_t memory() const override { return own_memory() + next_.memory(); }

 protected:
  /// Bytes of scratch files, and of memory at most.
  virtual std::uint64_t own_bytes() const = 0;
  virtual std::uint64_t own_memory() const = 0;

  MeshSink& next() { return next_; }
  const MeshSink& next() const { return next_; }
  /// Throws Cancelled when an end was requested. To be called for every few thousand elements.
  void check_cancelled() const {
    if (cancel_requested() || cancel_.stop_requested())
      throw Cancelled("the operation was cancelled");
  }

 private:
  MeshSink& next_;
  std::stop_token cancel_;
};

}  // namespace isobrick

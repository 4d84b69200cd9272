#pragma once

#include <atomic>
#include <optional>
#include <utility>

#include "viewer/scene/slice_image.h"
#include "viewer/scene/stream_plan.h"

namespace isobrick::inline v0 {

/// A request for a mesh, or for the slice of a slot. It is also the cancellation token that the
/// thread checks. Thread-safe.
class StreamRequest final : public CancellationToken {
 public:
  explicit StreamRequest(const MeshJob& mesh) : mesh_(mesh) {}
  StreamRequest(int slot, const SliceRequest& slice) : slot_(slot), slice_(slice) {}

  void check() const override {
    if (cancelled()) throw OperationCancelled();
  }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  void set_cancelled(bool cancelled) { cancelled_ = cancelled; }

  /// A device makes what it has received, even if the request is cancelled.
  bool sent_to_device() const { return sent_; }
  void set_sent_to_device(bool sent) { sent_ = sent; }

  bool is_slice() const { return slot_.has_value(); }
  const MeshJob& mesh() const { return mesh_; }
  int slot() const { return *slot_; }
  const SliceRequest& slice() const { return slice_; }

 private:
  const MeshJob mesh_;
  const std::optional<int> slot_;
  const SliceRequest slice_;
  std::atomic<bool> cancelled_ = false, sent_ = false;
};

}  // namespace isobrick

#pragma once

#include <map>
#include <memory>
#include <optional>

#include "core/thread_annotations.h"
#include "viewer/scene/request_queue.h"

namespace isobrick::inline v0 {

/// The requested slices, each in a numbered slot, and the last finished image of each. Thread-safe.
class SliceSlots {
 public:
  /// `queue` must outlive it.
  explicit SliceSlots(RequestQueue& queue) : queue_(queue) {}

  /// Requests a slice for a slot, or clears the slot. The present image stays until the new one is
  /// finished.
  void set(int slot, const std::optional<SliceRequest>& slice);
  /// The last finished image of a slot; null if there is none.
  std::shared_ptr<const SliceSamples> image(int slot) const;

  /// Stores the image made for a request; null: none was made. Returns false if the slot holds
  /// another request now.
  bool put(const StreamRequest& request, std::shared_ptr<const SliceSamples> image);
  /// Drops all images.
  void clear();

 private:
  struct Slot {
    RequestQueue::RequestPtr requested;  ///< waiting or running
    std::shared_ptr<const SliceSamples> image;
  };

  RequestQueue& queue_;
  mutable Mutex mutex_;
  std::map<int, Slot> slots_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick

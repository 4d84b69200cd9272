#pragma once

#include <map>
#include <memory>
#include <optional>

#include "core/thread_annotations.h"
#include "viewer/scene/request_queue.h"

namespace isobrick {

/// The slices that somebody looks at, each in a slot of its own, and the last finished image of
/// each. Thread-safe.
class SliceSlots {
 public:
  /// `queue` outlives it.
  explicit SliceSlots(RequestQueue& queue) : queue_(queue) {}

  /// From now on the slot holds this slice, or none. An image that is there stays until the
  /// requested one is finished.
  void set(int slot, const std::optional<SliceRequest>& slice);
  /// Null while there is none.
  std::shared_ptr<const SliceSamples> image(int slot) const;

  /// Takes over what was made for a request; null: nothing. False where the slot holds another
  /// slice by now.
  bool put(const StreamRequest& request, std::shared_ptr<const SliceSamples> image);
  /// Drops all images.
  void clear();

 private:
  struct Slot {
    RequestQueue::RequestPtr requested;  ///< that waits or is being made
    std::shared_ptr<const SliceSamples> image;
  };

  RequestQueue& queue_;
  mutable Mutex mutex_;
  std::map<int, Slot> slots_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick

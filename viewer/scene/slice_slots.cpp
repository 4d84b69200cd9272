#include "viewer/scene/slice_slots.h"

#include <utility>

namespace isobrick::inline v0 {

void SliceSlots::set(int slot, const std::optional<SliceRequest>& slice) {
  const MutexLock lock(mutex_);
  Slot& place = slots_[slot];
  if (place.requested && slice && place.requested->slice() == *slice) return;
  if (place.requested) queue_.cancel_slice(*std::exchange(place.requested, nullptr));
  if (!slice) {
    place.image.reset();
  } else if (!place.image || place.image->request != *slice) {
    place.requested = std::make_shared<StreamRequest>(slot, *slice);
    queue_.add_slice(place.requested);
  }
}

std::shared_ptr<const SliceSamples> SliceSlots::image(int slot) const {
  const MutexLock lock(mutex_);
  const auto found = slots_.find(slot);
  return found == slots_.end() ? nullptr : found->second.image;
}

bool SliceSlots::put(const StreamRequest& request, std::shared_ptr<const SliceSamples> image) {
  const MutexLock lock(mutex_);
  const auto found = slots_.find(request.slot());
  if (found == slots_.end() || found->second.requested.get() != &request) return false;
  found->second.requested.reset();
  if (image) found->second.image = std::move(image);
  return true;
}

void SliceSlots::clear() {
  std::map<int, Slot> dropped;
  const MutexLock lock(mutex_);
  dropped.swap(slots_);
}

}  // namespace isobrick

#pragma once

#include <memory>
#include <string>
#include <utility>

#include "core/thread_annotations.h"
#include "viewer/scene/device_mesher.h"

namespace isobrick::inline v0 {

/// The device that makes a stream's meshes, until the device fails. Thread-safe.
class CurrentDevice {
 public:
  /// Null: no device. A device that has failed is not taken.
  void set(std::shared_ptr<DeviceMesher> device) {
    std::string failure = device ? device->failure() : std::string();
    if (!failure.empty()) device.reset();
    const MutexLock lock(mutex_);
    failure_ = std::move(failure);
    std::swap(device_, device);  // the previous device is destroyed without the lock
  }
  std::shared_ptr<DeviceMesher> get() const {
    const MutexLock lock(mutex_);
    return device_;
  }
  bool is_set() const {
    const MutexLock lock(mutex_);
    return device_ != nullptr;
  }
  /// Releases a device that has failed, unless another one has been set meanwhile.
  void drop(const std::shared_ptr<DeviceMesher>& failed, const std::string& failure) {
    const MutexLock lock(mutex_);
    if (device_ != failed) return;
    device_.reset();
    failure_ = failure;
  }
  /// Why the last device failed; empty if it has not.
  std::string failure() const {
    const MutexLock lock(mutex_);
    return failure_;
  }

 private:
  mutable Mutex mutex_;
  std::shared_ptr<DeviceMesher> device_ ISOBRICK_GUARDED_BY(mutex_);
  std::string failure_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick

#pragma once

#include <chrono>
#include <optional>

#include "core/thread_annotations.h"

namespace isobrick::inline v0 {

/// Decides when a plan skips the levels between the coarsest one and the cut's. That is where most
/// of a cut is new and all of it can be made soon: the intermediate meshes would be replaced at
/// once. Thread-safe.
class LevelSkipping {
 public:
  /// `threads`: how many make meshes.
  explicit LevelSkipping(int threads) : threads_(threads) {}

  /// Reports another isovalue. Nothing is skipped while an isovalue slides.
  void isovalue_changed() {
    const MutexLock lock(mutex_);
    const auto now = Clock::now();
    changed_twice_ = last_isovalue_ && now - *last_isovalue_ < kSliding;
    last_isovalue_ = now;
    skipping_until_.reset();
  }
  /// Reports the time that a thread took for a mesh.
  void add_mesh_seconds(double seconds) {
    const MutexLock lock(mutex_);
    seconds_per_mesh_ += (seconds - seconds_per_mesh_) * kWeight;
  }

  /// How many meshes can be made within kMaxDelay; see plan_jobs().
  double max_meshes() const {
    const MutexLock lock(mutex_);
    if (changed_twice_ && Clock::now() - *last_isovalue_ < kSliding) return 0;
    return kMaxDelay.count() / seconds_per_mesh_ * threads_;
  }
  /// Reports whether the current plan skips levels.
  void set_plan(bool skips) {
    const MutexLock lock(mutex_);
    if (!skips)
      skipping_until_.reset();
    else if (!skipping_until_)
      skipping_until_ = Clock::now() + kDeadline;
  }
  /// Whether the meshes of a plan that skips are overdue: then the intermediate levels are needed.
  bool is_overdue() const {
    const MutexLock lock(mutex_);
    return skipping_until_ && Clock::now() > *skipping_until_;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::duration<double> kMaxDelay{0.1};
  static constexpr std::chrono::milliseconds kDeadline{300};
  /// An isovalue that changes again within this time is sliding.
  static constexpr std::chrono::milliseconds kSliding{300};
  /// Weight of one mesh in the moving average.
  static constexpr double kWeight = 1.0 / 32;

  const double threads_;
  mutable Mutex mutex_;
  double seconds_per_mesh_ ISOBRICK_GUARDED_BY(mutex_) = 0.003;  ///< moving average
  bool changed_twice_ ISOBRICK_GUARDED_BY(mutex_) = false;       ///< the isovalue slides
  std::optional<Clock::time_point> last_isovalue_ ISOBRICK_GUARDED_BY(mutex_);
  std::optional<Clock::time_point> skipping_until_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick

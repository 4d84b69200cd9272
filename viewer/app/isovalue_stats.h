#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include <isobrick/histogram.h>
#include "core/thread_annotations.h"
#include "viewer/scene/isovalue_counts.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick {

/// What is known about the isovalues of a store: how its samples spread, counted in a
/// thread of its own, and how much surface there is, from the ranges.
class IsovalueStats {
 public:
  explicit IsovalueStats(std::shared_ptr<const StoreReader> store);
  /// Ends the count.
  ~IsovalueStats();

  /// The histogram, once it is counted. Null before and when it failed.
  std::shared_ptr<const Histogram> histogram() const;
  /// Why it failed, once; empty when it has not, or that was taken before.
  std::string take_failure();

  /// Of level 0.
  const IsovalueCounts& counts() const { return counts_; }
  /// About how many triangles level 0 has, as many a block as the meshes made so far.
  double triangles(double isovalue, const StreamCounters& made) const;

 private:
  IsovalueCounts counts_;
  std::atomic<bool> stop_ = false;
  mutable Mutex mutex_;
  std::shared_ptr<const Histogram> histogram_ ISOBRICK_GUARDED_BY(mutex_);
  std::string failure_ ISOBRICK_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace isobrick

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

namespace isobrick::inline v0 {

/// Statistics of a store's isovalues: the histogram of its samples, counted by a thread of its own,
/// and the size of surfaces, from the ranges.
class IsovalueStats {
 public:
  explicit IsovalueStats(std::shared_ptr<const StoreReader> store);
  /// Cancels the count.
  ~IsovalueStats();

  /// The histogram; null until it is counted, and if that failed.
  std::shared_ptr<const Histogram> histogram() const;
  /// Returns why the count failed, once; else empty.
  std::string take_failure();

  /// Of level 0.
  const IsovalueCounts& counts() const { return counts_; }
  /// Estimates the triangles of an isosurface of level 0. `made`: for the triangles per block.
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

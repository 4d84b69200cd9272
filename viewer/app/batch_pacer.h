#pragma once

#include <algorithm>
#include <cstdint>

namespace isobrick::inline v0 {

/// Chooses the work of a draw batch in software; see Renderer::advance(). The first batch is small.
/// A batch that exceeds its time limit halves the next ones; one that leaves a quarter of it makes
/// them a quarter larger. Not thread-safe.
class BatchPacer {
 public:
  /// Work of the next batch.
  std::uint64_t work() const { return static_cast<std::uint64_t>(work_); }

  /// Reports that a batch of work() took `seconds`; it should take at most `limit`.
  void add(double seconds, double limit) {
    if (seconds > limit)
      work_ = std::max(work_ / 2, kMinWork);
    else if (seconds < kFull * limit)
      work_ *= kGrowth;
  }

 private:
  /// Smaller batches take no less time, since each batch has a fixed cost.
  static constexpr double kMinWork = 5'000;
  static constexpr double kFull = 0.75, kGrowth = 1.25;

  double work_ = kMinWork;
};

}  // namespace isobrick

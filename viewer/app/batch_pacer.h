#pragma once

#include <algorithm>
#include <cstdint>

namespace isobrick {

/// How much of a picture one piece holds where OpenGL is software; see Renderer::advance().
/// The first piece is small. A piece that took longer than its limit halves the next ones, one that
/// left a quarter of it makes them a quarter larger. Not thread-safe.
class BatchPacer {
 public:
  /// Of the next piece.
  std::uint64_t work() const { return static_cast<std::uint64_t>(work_); }

  /// A piece of work() took `seconds`, which should be at most `limit`.
  void add(double seconds, double limit) {
    if (seconds > limit)
      work_ = std::max(work_ / 2, kMinWork);
    else if (seconds < kFull * limit)
      work_ *= kGrowth;
  }

 private:
  /// Less takes no shorter, since each piece has a price of its own.
  static constexpr double kMinWork = 5'000;
  static constexpr double kFull = 0.75, kGrowth = 1.25;

  double work_ = kMinWork;
};

}  // namespace isobrick

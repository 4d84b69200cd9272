#pragma once

#include <chrono>

namespace isobrick {

/// Tells how long steps take that follow each other.
class Stopwatch {
 public:
  /// Seconds since the last call, or since this was made.
  double lap() {
    const auto now = Clock::now();
    const std::chrono::duration<double> passed = now - last_;
    last_ = now;
    return passed.count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
};

}  // namespace isobrick

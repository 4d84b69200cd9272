#pragma once

#include <chrono>

namespace isobrick::inline v0 {

/// Measures steps that follow each other, or adds the time of a scope to a sum.
class Stopwatch {
 public:
  Stopwatch() = default;
  /// Adds the seconds until its destruction to `sum`.
  explicit Stopwatch(double& sum) : sum_(&sum) {}
  ~Stopwatch() {
    if (sum_) *sum_ += lap();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

  /// Seconds since the last call, or since the construction.
  double lap() {
    const auto now = Clock::now();
    const std::chrono::duration<double> passed = now - last_;
    last_ = now;
    return passed.count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  double* sum_ = nullptr;
  Clock::time_point last_ = Clock::now();
};

}  // namespace isobrick

#pragma once

#include <chrono>

namespace isobrick {

/// Adds the time it lives to a sum of seconds.
class SecondsSum {
 public:
  explicit SecondsSum(double& sum) : sum_(sum) {}
  ~SecondsSum() {
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start_;
    sum_ += took.count();
  }
  SecondsSum(const SecondsSum&) = delete;
  SecondsSum& operator=(const SecondsSum&) = delete;

 private:
  double& sum_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace isobrick

#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

namespace isobrick::bench {

/// Whether the machine keeps its pace: a thread does the same arithmetic over and over, in
/// registers alone, and notes the processor time that it took. Where that is several times as long,
/// the processor is slow: another thread on the same core takes a half of it at most. It takes a
/// twelfth of a core.
class MachinePace {
 public:
  using Clock = std::chrono::steady_clock;

  /// How many times the least time the arithmetic took between two moments, at most.
  double slower(Clock::time_point from, Clock::time_point to) const {
    const std::lock_guard lock(mutex_);
    const auto first = std::partition_point(samples_.begin(), samples_.end(),
                                            [&](const Sample& s) { return s.end < from; });
    double most = 0;
    for (auto s = first; s != samples_.end() && s->begin <= to; ++s) most = std::max(most, s->took);
    return most / least_;
  }

 private:
  struct Sample {
    Clock::time_point begin, end;
    double took;  ///< seconds of processor time
  };

  static double processor_seconds() {
    std::timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }

  void run(const std::stop_token& stop) {
    std::uint64_t x = 1;
    while (!stop.stop_requested()) {
      const auto begin = Clock::now();
      const double before = processor_seconds();
      // Long enough that an interrupt is no matter.
      for (int i = 0; i < 200'000; ++i) x ^= x << 13, x ^= x >> 7, x ^= x << 17;
      const double took = processor_seconds() - before;
      {
        const std::lock_guard lock(mutex_);
        if (x != 0) samples_.push_back({begin, Clock::now(), took});  // so that x is needed
        least_ = std::min(least_, took);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(3));
    }
  }

  mutable std::mutex mutex_;
  std::vector<Sample> samples_;
  double least_ = std::numeric_limits<double>::infinity();
  std::jthread thread_{[this](const std::stop_token& stop) { run(stop); }};
};

}  // namespace isobrick::bench

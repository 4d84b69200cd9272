#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

#include <isobrick/device_volume.h>
#include "bench/median.h"

// How long a volume on the device takes to a mesh, as all benches of it measure.

namespace isobrick::bench {

/// Seconds from an isovalue that was `other` before to the mesh in device memory, its size known
/// to the caller; the median.
inline double changed_isovalue_seconds(gpu::ResidentExtractor& extractor, double isovalue,
                                       double other, int runs) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> seconds;
  for (int i = 0; i < runs; ++i) {
    extractor.extract(other);
    const auto start = Clock::now();
    extractor.extract(isovalue);
    seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
  }
  return median(seconds);
}

/// Milliseconds of the last mesh made again, by events, after three that do not count; sorted.
inline std::vector<float> repeat_milliseconds(gpu::ResidentExtractor& extractor, int runs) {
  std::vector<float> times;
  for (int i = -3; i < runs; ++i) {
    extractor.repeat();
    const float ms = extractor.milliseconds();
    if (i >= 0) times.push_back(ms);
  }
  std::sort(times.begin(), times.end());
  return times;
}

}  // namespace isobrick::bench

#pragma once

#include <tbb/info.h>

#include <algorithm>

namespace isobrick::inline v0 {

/// Threads of a sink or filter that was given `wanted`, 0 for all cores. More than there are cores
/// gain nothing there, and outside of an operation oneTBB would write a warning.
inline int thread_count(int wanted) {
  const int cores = tbb::info::default_concurrency();
  return wanted > 0 ? std::min(wanted, cores) : cores;
}

}  // namespace isobrick

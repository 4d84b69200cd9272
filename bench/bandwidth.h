#pragma once

#include <cstddef>

namespace isobrick::bench {

/// Bytes a second of a kernel that only reads, and of one that only writes,
/// device memory; the better of several runs over `bytes`.
struct Bandwidth {
  double read = 0, write = 0;
};
Bandwidth measure_bandwidth(std::size_t bytes);

}  // namespace isobrick::bench

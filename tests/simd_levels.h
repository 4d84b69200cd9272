#pragma once

#include <vector>

#include "core/simd_targets.h"

namespace isobrick::testing {

/// The levels that this processor has, the least first.
inline std::vector<SimdLevel> simd_levels() {
  std::vector<SimdLevel> levels;
  for (int level = 0; level <= static_cast<int>(simd_level()); ++level)
    levels.push_back(static_cast<SimdLevel>(level));
  return levels;
}

/// Keeps functions of higher levels from being taken.
class SimdLevelLimit {
 public:
  explicit SimdLevelLimit(SimdLevel level) { max_simd_level = level; }
  ~SimdLevelLimit() { max_simd_level = SimdLevel::avx3_dl; }
  SimdLevelLimit(const SimdLevelLimit&) = delete;
  SimdLevelLimit& operator=(const SimdLevelLimit&) = delete;
};

}  // namespace isobrick::testing

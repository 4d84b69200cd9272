#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "isobrick/core/progress.h"
#include "isobrick/core/selection.h"

namespace isobrick {

struct VerifyReport {
  struct Index {
    int level;
    std::string kind;
  };
  std::uint64_t bricks = 0, bytes = 0;
  std::vector<Index> indexes;  ///< those that were checked
  std::vector<std::string>
      damages;  ///< one line each: level, brick, file, offset, what; at most 1000 kept
  std::uint64_t damage_count = 0;
};

/// Reads all of a store: metadata, shard indices, every brick's checksum and
/// size, the ranges against the samples, and every index against both. Only an unreadable root
/// throws.
VerifyReport verify(const std::filesystem::path& store, int threads, Progress& progress,
                    const Selection& selection = {});

}  // namespace isobrick

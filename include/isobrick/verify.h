#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/progress.h>
#include <isobrick/selection.h>

namespace isobrick::inline v0 {

/// What was checked, and what is wrong.
struct VerifyReport {
  /// An index that was checked.
  struct Index {
    int level;         ///< of the store
    std::string kind;  ///< its name
  };
  std::uint64_t bricks = 0;    ///< bricks that were checked
  std::uint64_t bytes = 0;     ///< bytes that were read
  std::vector<Index> indexes;  ///< indices that were checked
  /// One line each: level, brick, file, offset, what; at most 1000 kept.
  std::vector<std::string> damages;
  std::uint64_t damage_count = 0;  ///< all damages, also those that are not kept
};

/// Reads all of a store: metadata, shard indices, every brick's checksum and
/// size, the ranges against the samples, and every index against both. What cannot be looked at
/// counts as damage. Within `memory` bytes, with fewer threads where they take too much of it.
/// Throws when the root cannot be read, and UsageError when the budget is too small, with the
/// least that is not.
ISOBRICK_API VerifyReport verify(const std::filesystem::path& store, int threads = 0,
                                 Progress& progress = no_progress(),
                                 const Selection& selection = {},
                                 std::uint64_t memory = std::uint64_t{1} << 30);

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
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

/// How a store is checked.
struct VerifyOptions {
  int threads = 0;                                ///< 0: all cores
  Selection selection = {};                       ///< which image of several
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Reads all of a store: metadata, shard indices, every brick's checksum and
/// size, the ranges against the samples, and every index against both. What cannot be looked at
/// counts as damage. Takes fewer threads where they need more memory than the budget has.
/// Throws when the root cannot be read, and UsageError when the budget is too small, with the
/// least that is not.
ISOBRICK_API VerifyReport verify(const std::filesystem::path& store,
                                 const VerifyOptions& options = {},
                                 Progress& progress = no_progress());

}  // namespace isobrick

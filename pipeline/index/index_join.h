#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <tuple>
#include <vector>

#include <isobrick/index_build.h>
#include <isobrick/store_reader.h>
#include "pipeline/index/add_ranges.h"
#include "pipeline/index/index_parts.h"
#include "pipeline/index/level_index.h"

namespace isobrick::inline v0 {

/// All parts of an index, to be made one.
class JoinedIndexParts {
 public:
  /// Throws Error naming the parts that are missing, or that are of the store as it was before
  /// something in it changed. `levels` are what there is of the index.
  JoinedIndexParts(const StoreReader& store, const IndexOptions& options,
                   const std::vector<LevelIndex>& levels);

  /// Gives the store the ranges that the parts computed. Throws UsageError where the budget has no
  /// room for what is merged.
  void add_ranges(std::uint64_t memory, Progress& progress) const;
  /// Takes the chunks of a level.
  TakeIndexChunk chunks_of(int level, Publisher& publisher) const;
  /// What the parts made goes.
  void remove() const { parts_.remove(); }

 private:
  /// A chunk as a part left it.
  struct Found {
    std::filesystem::path path;
    IndexChunkName name;
  };
  using Place = std::tuple<int, Index, Index, Index>;  ///< level, z, y, x

  void find_chunks(std::uint32_t number, const std::vector<LevelIndex>& levels);
  bool merge(int level, LevelRangeOutput& output, ValueCounts& counts, Progress& progress) const;

  const StoreReader& store_;
  const IndexOptions& options_;
  IndexParts parts_;
  std::map<Place, Found> chunks_;
};

}  // namespace isobrick

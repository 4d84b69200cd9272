#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <isobrick/index_build.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_chunk.h"
#include "bricks/ranges/index_layout.h"
#include "bricks/store_entries.h"
#include "bricks/zarr/publisher.h"
#include "pipeline/index/index_chunk_builder.h"

namespace isobrick::inline v0 {

/// Puts a chunk that others have made at `path`. False where there is none.
using TakeIndexChunk =
    std::function<bool(const IndexChunkName& chunk, const std::filesystem::path& path)>;

/// Whether ranges must be computed first: the store lacks some, or is of another program and
/// `force` is set.
bool needs_ranges(const StoreReader& store, const IndexOptions& options);

/// What an index of a level of a store is like.
IndexLayout index_layout(const StoreReader& store, int level, const IndexOptions& options);

IndexLayout index_layout(const StoreReader& store, int level, std::string kind, Index leaf);

/// One level's index on its way into the store: it grows as KIND.partial beside its place.
class LevelIndex {
 public:
  /// Of the kind and leaf of `layout`; of the options only how it is built matters. The store and
  /// the options must outlive it.
  LevelIndex(const StoreReader& store, int level, const IndexOptions& options, IndexLayout layout);

  /// Throws UsageError when there is one and neither `resume` nor `force` is set.
  void check() const;
  /// Whether the index to build is there already.
  bool is_there() const { return is_wanted(place_); }
  /// Whether an earlier run has left this chunk, whole, and prepare() keeps it.
  bool has_chunk(Int3 chunk) const;
  /// Decides what of an earlier run stays, and makes the folder.
  void prepare(Publisher& publisher);
  const IndexLayout& layout() const { return layout_; }
  /// Builds the chunks that `take`, if there is any, does not have and that are not there.
  void build(const MakeIndexParts& make, Publisher& publisher, Progress& progress,
             IndexReport& report, const TakeIndexChunk& take = nullptr) const;
  void publish(const OutputFolder& folder) const;

 private:
  std::filesystem::path place_in_store() const { return index_folder_in_store_; }
  void remove(const OutputFolder& root, const std::filesystem::path& folder) const;
  bool is_wanted(const std::filesystem::path& folder) const;
  bool is_finished() const;

  const StoreReader& store_;
  int level_;
  const IndexOptions& options_;
  StoreEntries entries_;
  IndexLayout layout_;
  std::filesystem::path index_folder_in_store_, place_, partial_;
  bool finished_ = false;  ///< by an earlier run
};

/// Makes one chunk as a file of that name.
void build_index_chunk(const MakeIndexParts& make, const IndexLayout& layout,
                       const IndexChunkName& name, const std::filesystem::path& path,
                       Publisher& publisher);

}  // namespace isobrick

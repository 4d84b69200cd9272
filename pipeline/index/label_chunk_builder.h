#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <isobrick/store_reader.h>
#include "index/label_lists.h"
#include "pipeline/index/index_chunk_builder.h"

namespace isobrick::inline v0 {

/// Of an index of label lists of a level.
IndexLayout label_index_layout(const StoreReader& store, int level);

/// Makes the parts of a level's index of label lists: the directory has a list for each index
/// brick, and a part one for each tile of a brick with several labels. Bricks whose range is one
/// value are not read.
class LabelChunkBuilder {
 public:
  /// The least memory for a level of this lattice.
  static std::uint64_t min_memory(const Lattice& lattice, int threads);

  /// `memory` is no less than the least.
  LabelChunkBuilder(const StoreReader& store, int level, const IndexLayout& layout,
                    std::uint64_t memory, int threads);

  /// Parallel in the caller's arena. The directory comes last. Throws Error where a sample is no
  /// label.
  void build(Int3 chunk, const EncodeIndexPart& encode, const TakeIndexPart& take) const;

 private:
  class Chunk;

  StoreReader store_;
  int level_;
  const IndexLayout& layout_;
  Index piece_ = 1;  ///< index bricks along each edge of what is read at a time
};

/// The same as a function, which owns the builder.
MakeIndexParts label_index_parts(const StoreReader& store, int level, const IndexLayout& layout,
                                 std::uint64_t memory, int threads);

}  // namespace isobrick

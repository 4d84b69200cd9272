#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_layout.h"

namespace isobrick::inline v0 {

/// Makes the parts of a level's index chunks from the level's ranges and, for
/// leaves below 16, from its samples. Bricks whose range no isovalue stabs have
/// no part and are not read.
class IndexChunkBuilder {
 public:
  /// The least memory for a level of this lattice.
  static std::uint64_t min_memory(const Lattice& lattice, Index leaf, int threads);

  /// `memory` is no less than the least.
  IndexChunkBuilder(const StoreReader& store, int level, const IndexLayout& layout, IndexKind kind,
                    std::uint64_t memory, int threads);

  /// What becomes of each part; called from any thread.
  using Encode = std::function<std::vector<std::byte>(std::vector<std::byte>)>;
  /// Takes a part of a chunk, encoded.
  using Take = std::function<void(std::size_t part, std::vector<std::byte>)>;

  /// The directory first, then the index bricks in Morton order, whatever the
  /// memory. Parallel in the caller's arena.
  void build(Int3 chunk, const Encode& encode, const Take& take) const;

 private:
  template <class T>
  class Chunk;

  const StoreReader& store_;
  int level_;
  const IndexLayout& layout_;
  IndexKind kind_;
  std::size_t batch_ = 1;  ///< parts made at a time
  Index piece_ = 1;        ///< index bricks along each edge of what is read at a time
};

}  // namespace isobrick

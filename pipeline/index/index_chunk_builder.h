#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_layout.h"

namespace isobrick::inline v0 {

/// What the index of a level is made of.
enum class IndexInput : std::uint8_t {
  ranges,  ///< those of the store and, for leaves below 16, samples that its checksums match
  samples  ///< samples alone, as they are now; for leaves below 16
};

/// Makes the parts of a level's index chunks from the level's ranges and, for
/// leaves below 16, from its samples. Bricks whose range no isovalue stabs have
/// no part. Where there are ranges, such bricks are not read.
class IndexChunkBuilder {
 public:
  /// The least memory for a level of this lattice.
  static std::uint64_t min_memory(const Lattice& lattice, Index leaf, int threads);

  /// `memory` is no less than the least.
  IndexChunkBuilder(const StoreReader& store, int level, const IndexLayout& layout, IndexKind kind,
                    std::uint64_t memory, int threads, IndexInput input = IndexInput::ranges);

  /// What becomes of each part; called from any thread.
  using Encode = std::function<std::vector<std::byte>(std::vector<std::byte>)>;
  /// Takes a part of a chunk, encoded.
  using Take = std::function<void(std::size_t part, std::vector<std::byte>)>;

  /// The directory first, then the index bricks in Morton order, whatever the
  /// memory; of samples alone the directory comes last. Parallel in the caller's arena.
  void build(Int3 chunk, const Encode& encode, const Take& take) const;

 private:
  template <class T>
  class Chunk;

  const StoreReader& store_;
  int level_;
  const IndexLayout& layout_;
  IndexKind kind_;
  IndexInput input_;
  std::size_t batch_ = 1;  ///< parts made at a time
  Index piece_ = 1;        ///< index bricks along each edge of what is read at a time
};

}  // namespace isobrick

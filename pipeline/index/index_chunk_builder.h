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

/// The samples of a cube of so many index bricks along each edge, with the layer of their upper
/// neighbours.
std::uint64_t index_piece_bytes(const Lattice& lattice, Index bricks);
/// What reading samples takes: shard indices, and a brick a thread, encoded and decoded.
std::uint64_t index_reading_bytes(const Lattice& lattice, int threads);

/// What becomes of each part of an index chunk; called from any thread.
using EncodeIndexPart = std::function<std::vector<std::byte>(std::vector<std::byte>)>;
/// Takes a part of a chunk, encoded.
using TakeIndexPart = std::function<void(std::size_t part, std::vector<std::byte>)>;
/// Makes the parts of a chunk: each is encoded, then taken.
using MakeIndexParts =
    std::function<void(Int3 chunk, const EncodeIndexPart& encode, const TakeIndexPart& take)>;

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

  using Encode = EncodeIndexPart;
  using Take = TakeIndexPart;

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

/// The same as a function, which owns the builder.
MakeIndexParts span_index_parts(const StoreReader& store, int level, const IndexLayout& layout,
                                IndexKind kind, std::uint64_t memory, int threads,
                                IndexInput input = IndexInput::ranges);

}  // namespace isobrick

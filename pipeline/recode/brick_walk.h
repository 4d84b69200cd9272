#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/store_reader.h>
#include "bricks/store_layout.h"
#include "bricks/store_writer.h"

namespace isobrick::inline v0 {

/// A brick on its way from one store to another, or a shard that is there already.
struct MovedBrick {
  int level = 0;
  Int3 shard, brick;
  bool kept = false;  ///< the whole shard: an interrupted run finished it
  bool last = false;  ///< of its shard
  std::optional<std::vector<std::byte>> encoded = {};  ///< nothing: absent
};

/// All bricks of all levels, shard after shard, and those of a shard in C order, as convert()
/// writes them. Hints those that follow to the store that is read.
class BrickWalk {
 public:
  BrickWalk(const StoreReader& from, const StoreLayout& layout, const StoreWriter& to)
      : from_(from), layout_(layout), to_(to) {}

  /// False: there are no more. From one thread.
  bool next(MovedBrick& brick);

 private:
  bool next_shard(MovedBrick& brick);
  void hint(Index begin, Index end);
  Int3 brick_at(Index i) const;

  const StoreReader& from_;
  const StoreLayout& layout_;
  const StoreWriter& to_;
  int level_ = 0;
  Index shard_ = 0;  ///< the next one of the level
  Int3 at_shard_;    ///< where the walk is
  Box3 bricks_;      ///< of that shard
  Index next_ = 0;   ///< of them
};

}  // namespace isobrick

#include "pipeline/recode/brick_walk.h"

#include <algorithm>

namespace isobrick::inline v0 {
namespace {

/// Bricks that are hinted together.
constexpr Index kHinted = 32;

}  // namespace

Int3 BrickWalk::brick_at(Index i) const { return bricks_.lo + point_at(i, bricks_.extent()); }

void BrickWalk::hint(Index begin, Index end) {
  std::vector<Int3> soon;
  for (Index i = begin; i < std::min(end, volume(bricks_.extent())); ++i)
    soon.push_back(brick_at(i));
  if (!soon.empty() && !from_.reads_memory()) from_.will_need(level_, soon);
}

bool BrickWalk::next(MovedBrick& brick) {
  if (next_ == volume(bricks_.extent())) {
    if (!next_shard(brick)) return false;
    if (brick.kept) return true;
  }
  if (next_ == 0) hint(0, kHinted);
  if (next_ % kHinted == 0) hint(next_ + kHinted, next_ + 2 * kHinted);
  brick = {.level = level_, .shard = at_shard_, .brick = brick_at(next_)};
  brick.last = ++next_ == volume(bricks_.extent());
  return true;
}

/// Goes to the next shard; what is kept of it has no bricks.
bool BrickWalk::next_shard(MovedBrick& brick) {
  const LevelInfo* info = nullptr;
  Int3 shards;
  for (;; ++level_, shard_ = 0) {
    if (level_ == static_cast<int>(layout_.levels.size())) return false;
    info = &layout_.levels[static_cast<std::size_t>(level_)];
    shards = ceil_div(info->lattice.extent, info->shard);
    if (shard_ < volume(shards)) break;
  }
  at_shard_ = point_at(shard_++, shards);
  const Int3 n = ceil_div(info->shard, info->lattice.brick);
  bricks_ = intersect({at_shard_ * n, (at_shard_ + Int3{1, 1, 1}) * n},
                      {{0, 0, 0}, info->lattice.bricks()});
  next_ = 0;
  brick = {.level = level_, .shard = at_shard_};
  brick.kept = to_.shard_is_whole(level_, at_shard_);
  if (brick.kept) next_ = volume(bricks_.extent());
  return true;
}

}  // namespace isobrick

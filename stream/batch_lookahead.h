#pragma once

#include <cstddef>
#include <deque>
#include <unordered_set>

#include "stream/brick_reader.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {

/// The batches of a planner. Where bricks come over a network, further batches are planned ahead
/// and their bricks hinted at, so that many requests are under way. For one thread at a time.
class BatchLookahead {
 public:
  /// Both must outlive it.
  BatchLookahead(BatchPlanner& planner, const BrickReader& reader);

  /// As BatchPlanner::next().
  bool next(TileBatch& batch);

 private:
  bool plan();
  void hint(const TileBatch& batch);

  BatchPlanner& planner_;
  const BrickReader& reader_;
  const std::size_t max_bricks_;  ///< of the batches that are planned ahead
  std::deque<TileBatch> planned_;
  std::size_t planned_bricks_ = 0;
  // Bricks that were hinted at lately: neighbouring batches share some.
  std::deque<Int3> hinted_;
  std::unordered_set<Index> is_hinted_;
};

}  // namespace isobrick

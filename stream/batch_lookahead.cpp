#include "stream/batch_lookahead.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {
namespace {

/// Decoded bytes of the bricks that are hinted at ahead: more than a storage fetches ahead.
constexpr std::size_t kHintedBytes = std::size_t{512} << 20;
constexpr std::size_t kMaxHinted = 4096;

}  // namespace

BatchLookahead::BatchLookahead(BatchPlanner& planner, const BrickReader& reader)
    : planner_(planner),
      reader_(reader),
      max_bricks_(!reader.reads_network()
                      ? 0
                      : std::clamp<std::size_t>(kHintedBytes / reader.lattice().brick_bytes(), 1,
                                                kMaxHinted)) {}

bool BatchLookahead::next(TileBatch& batch) {
  while ((planned_.empty() || planned_bricks_ < max_bricks_) && plan()) {
  }
  if (planned_.empty()) return false;
  batch = std::move(planned_.front());
  planned_.pop_front();
  planned_bricks_ -= batch.bricks.size();
  return true;
}

bool BatchLookahead::plan() {
  TileBatch batch;
  if (!planner_.next(batch)) return false;
  if (max_bricks_ > 0) hint(batch);
  planned_bricks_ += batch.bricks.size();
  planned_.push_back(std::move(batch));
  return true;
}

void BatchLookahead::hint(const TileBatch& batch) {
  const Int3 grid = reader_.lattice().bricks();
  std::vector<Int3> bricks;
  for (const Int3 b : batch.bricks) {
    if (!is_hinted_.insert(linear_index(b, grid)).second) continue;
    bricks.push_back(b);
    hinted_.push_back(b);
    if (hinted_.size() <= 2 * max_bricks_) continue;
    is_hinted_.erase(linear_index(hinted_.front(), grid));
    hinted_.pop_front();
  }
  reader_.will_need(bricks);
}

}  // namespace isobrick

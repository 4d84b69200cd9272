#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <isobrick/progress.h>
#include "bricks/store_writer.h"
#include "pipeline/convert/brick_output.h"
#include "pipeline/convert/convert_journal.h"
#include "pipeline/index/range_scan.h"

namespace isobrick::inline v0 {

/// Writes one level of a store: bricks, encoded in parallel, and ranges. Counts its samples.
class LevelWriter {
 public:
  /// As BrickOutput.
  LevelWriter(StoreWriter& store, const StoreLayout& layout, int level, int bricks_in_flight,
              ConvertJournal* journal, ValueCounts* counts, Progress& progress);

  /// Writes the bricks of `box`, which is aligned to them, and merges its samples
  /// into the ranges; `samples` is dense. `meanwhile` runs on some thread beside
  /// that, so that no thread waits for the last brick.
  /// Bricks reach their shard in the order z, y, x of the calls and in each box,
  /// whatever the threads, so a shard's bytes are always the same.
  void write(Box3 box, const std::byte* samples, const std::function<void()>& meanwhile);

  /// All samples below z1 were written: puts them on the journal's record. Comes
  /// before anything made of them is finished, here or in a coarser level,
  /// because a resume takes what is finished as this input's.
  void record(Index z1);
  /// Finishes the shards and ranges that the samples below z1 complete.
  void close(Index z1);

  bool has_nan() const { return ranges_->has_nan(); }
  const BrickCounts& counts() const { return output_.counts(); }

 private:
  bool is_kept(Int3 shard) const {
    return kept_[static_cast<std::size_t>(linear_index(shard, shards_))];
  }
  void write_bricks(Box3 box, const std::byte* samples);
  void finish_shards(Index z1);

  StoreWriter& store_;
  const LevelInfo& info_;
  int level_;
  std::size_t bricks_in_flight_;
  Int3 shards_, bricks_per_shard_;
  std::vector<bool> kept_;  ///< shards that an interrupted run finished
  ConvertJournal* journal_;
  BrickOutput output_;
  std::unique_ptr<LevelRanges> ranges_;
  Index next_shard_z_ = 0;
};

}  // namespace isobrick

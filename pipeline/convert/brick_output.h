#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/progress.h>
#include "bricks/store_writer.h"
#include "pipeline/convert/convert_journal.h"
#include "pipeline/index/value_counts.h"

namespace isobrick::inline v0 {

/// A brick on its way to its shard.
struct PackedBrick {
  Int3 brick;
  bool kept = false;      ///< its shard was whole already
  std::uint32_t crc = 0;  ///< of the samples, for the journal
  std::optional<std::vector<std::byte>> encoded;
};

/// Of one level or of all: `kept` by a resume, `absent` as all fill value.
struct BrickCounts {
  std::uint64_t bricks = 0, absent = 0, kept = 0;
};

/// Where the bricks of one level go: encoded into the store, and on the journal's record.
class BrickOutput {
 public:
  /// `journal` and `histogram`, if there are any, see every brick. `progress` advances with each
  /// brick: by its samples in the input's own level, by nothing in coarser ones, where it still may
  /// throw to stop the conversion.
  BrickOutput(StoreWriter& store, const StoreLayout& layout, int level, ConvertJournal* journal,
              ValueCounts* histogram, Progress& progress);

  /// Encodes a brick of the samples of `box`, dense, in which it lies. `kept`: it is on disk
  /// already, and only the journal needs it. Thread-safe.
  PackedBrick pack(Int3 brick, Box3 box, const std::byte* samples, bool kept) const;
  /// The same of a brick all of whose samples are `bits` (see VolumeSource::constant); its box
  /// must be a full brick. Bricks of one value that come one after the other are encoded once.
  PackedBrick pack_constant(Int3 brick, std::uint64_t bits, bool kept);
  /// From one thread, in the order that the bricks of a shard will have.
  void deliver(const PackedBrick& packed);
  /// Bricks that are known to be the fill value and are not delivered.
  void skip(std::uint64_t bricks);

  const BrickCounts& counts() const { return counts_; }

 private:
  /// A brick of one value.
  struct Constant {
    std::uint64_t bits;
    std::uint32_t crc;
    std::optional<std::vector<std::byte>> encoded;
  };

  void encode(PackedBrick& packed, std::span<const std::byte> samples) const;

  StoreWriter& store_;
  const StoreLayout& layout_;
  int level_;
  const Lattice& lattice_;
  ConvertJournal* journal_;
  ValueCounts* histogram_;
  Progress& progress_;
  BrickCounts counts_;
  std::mutex mutex_;
  std::shared_ptr<const Constant> constant_;  ///< the last one; guarded by mutex_
};

}  // namespace isobrick

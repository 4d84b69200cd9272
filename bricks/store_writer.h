#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include <isobrick/image_metadata.h>
#include <isobrick/lattice.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/stored_histogram.h"
#include "bricks/ranges/stored_ranges.h"
#include "bricks/store_layout.h"

namespace isobrick::inline v0 {

/// Writes a store into a directory: bricks into shard files under temporary
/// names, metadata last. Bricks are given encoded, so encoding runs on any
/// number of threads; the bytes depend only on the order of `put` within a shard.
class StoreWriter {
 public:
  /// Creates `dir` or, with `resume`, goes on in it: shards that are whole are
  /// kept. Throws Error when `dir` was begun with another layout.
  StoreWriter(const std::filesystem::path& dir, const StoreLayout& layout, bool resume);
  /// Leaves what is finished for a resume; removes temporary files.
  ~StoreWriter();

  /// Whether shard `s` (in shards) of `level` was already whole when resuming.
  /// Looks at its index and size, not at its bricks. Its bricks need not be put.
  bool shard_is_whole(int level, Int3 s) const;

  /// Appends an encoded brick (see encode_brick) to its shard; nothing for an
  /// absent one. Thread-safe.
  void put(int level, Int3 brick, std::span<const std::byte> encoded);

  /// All bricks of the shard were put: index, sync, rename, the latter two on a
  /// thread of the writer's own. A failure there comes out of a later call, at
  /// the latest of finish().
  void finish_shard(int level, Int3 s);
  /// The same of a shard that was whole: takes the checksums of its bricks from its file.
  void keep_shard(int level, Int3 s);
  /// Takes a shard that another writer finished, from its folder `other` of the same layout and
  /// file system; one that was taken already stays. Then finish_shard() or keep_shard() follow:
  /// whether the shard has bricks.
  bool take_shard(int level, Int3 s, const std::filesystem::path& other);
  /// Returns when all shards that were finished are on disk, and throws what failed.
  void sync_shards();
  /// Removes what an earlier run may have left of a shard that has no bricks and is not finished.
  void forget_shard(int level, Int3 s);
  /// All shards with bricks below `z` (in bricks) are finished or kept; what was not put is
  /// absent. Not needed where that is done with every shard. From one thread.
  void finish_below(int level, Index z);

  /// Ranges of an aligned box of bricks or of 16³ blocks, as pairs (lo, hi) of
  /// the level's type, C order [z, y, x, 2] over `box`; each item exactly once.
  /// A chunk of ranges is kept in memory until all its items are known, so calls
  /// come in order of increasing z. A level without any is written without
  /// ranges. Thread-safe.
  void put_brick_ranges(int level, Box3 box, std::span<const std::byte> pairs);
  void put_block_ranges(int level, Box3 box, std::span<const std::byte> pairs);

  /// In place of both: those of another store that has the same samples, byte for byte. Throws
  /// DamageError where they are damaged.
  void copy_ranges(int level, const StoreReader& store, const RangeChecksums& checksums);

  /// The histogram of level 0. A store to which none is given, or that has no ranges, keeps none.
  void put_histogram(const SampleCounts& counts);

  /// Metadata, the group's last of all; then everything in `dir` is on disk (its
  /// own name is the caller's to sync).
  /// `may_have_nan` replaces the layout's, known only now. `window`, if there is one, reads the
  /// store and returns how it is shown at first. `more`, if there is one, adds to the store, which
  /// can be read by then, and may rename `dir`; until it returns the store keeps the mark of an
  /// interrupted conversion, so that a resume goes on.
  void finish(bool may_have_nan,
              const std::function<std::optional<DisplayWindow>()>& window = nullptr,
              const std::function<void()>& more = nullptr);

  /// Bytes written so far, all files.
  std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/index_kind.h>
#include <isobrick/lattice.h>
#include <isobrick/part.h>
#include <isobrick/progress.h>
#include <isobrick/selection.h>

namespace isobrick::inline v0 {

/// Cells along each edge of an item by default: the blocks by
/// which an extraction skips, whose ranges every store has. docs/design/search.md.
inline constexpr Index kDefaultLeaf = 16;

/// An index to add to a store.
struct IndexOptions {
  IndexKind kind = IndexKind::octree;             ///< its data structure
  Selection selection = {};                       ///< of an image with several channels or times
  Index leaf = kDefaultLeaf;                      ///< 1, 2, 4, 8 or 16 cells
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  bool resume = false;  ///< go on with an interrupted build of the same index
  bool force = false;   ///< replace an index of this kind, only when the new one is whole
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
  /// Makes only this part of what samples are read for, in the folder `store` + ".index.parts":
  /// the work of one of several tasks. What is whole there is kept. Ranges that the store lacks
  /// are divided by bricks, and with leaves below 16 the index by chunks; of other indices, made
  /// of ranges alone, a part has nothing to do. `resume` does not matter.
  std::optional<Part> part = {};
  /// Makes the index of so many parts that are all there, and what no part makes; 0: of none. The
  /// store is that of one call without parts. `resume` does not matter.
  std::uint32_t join = 0;
};

/// What adding an index did.
struct IndexReport {
  std::vector<std::uint64_t> level_bytes;  ///< of the index, the finest level first
  std::uint64_t chunks = 0;                ///< chunks of all levels
  std::uint64_t chunks_kept = 0;           ///< of them, those that an earlier call had made
  bool ranges_added = false;               ///< the store had none, or they were made anew
  double seconds = 0;                      ///< wall time, the ranges included
  double range_seconds = 0;                ///< wall time of the ranges
};

/// The least budget of such an index of `lattice`. Throws UsageError for a kind or leaf that stores
/// cannot have.
ISOBRICK_API std::uint64_t min_index_memory(const IndexOptions& options, const Lattice& lattice);

/// Throws UsageError for a kind or leaf that stores cannot have, and for a budget
/// that is too small for such an index of `lattice`, naming the least that does: that of the
/// command, of which `others` bytes are in use already.
ISOBRICK_API void check_index_options(const IndexOptions& options, const Lattice& lattice,
                                      std::uint64_t others = 0);

/// Adds an index of all levels to a store, that of another program too: ranges
/// that it lacks are computed first, and with `force` those of an image of others
/// again. An index grows as KIND.partial beside its place and moves there once it
/// is whole; until then the store is as it was. Throws UsageError when there is
/// one and neither `resume` nor `force` is set, and where parts to join are missing or are of the
/// store as it was before something in it changed. Throws it where the budget is too small, too,
/// and names the least that does. Throws Error when another process is at it.
ISOBRICK_API IndexReport add_index(const std::filesystem::path& store, const IndexOptions& options,
                                   Progress& progress = no_progress());

}  // namespace isobrick

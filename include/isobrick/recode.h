#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>

#include <isobrick/api.h>
#include <isobrick/brick_codec.h>
#include <isobrick/convert.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// How recode() writes a store.
struct RecodeOptions {
  /// packed is refused for stores of OME-Zarr 0.4, and automatic is zstd of them.
  BrickCodec codec = BrickCodec::automatic;
  int zstd_level = 3;                             ///< of zstd, 1 … 22
  double packed_factor = kMaxPackedFactor;        ///< of automatic: see kMaxPackedFactor
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  bool resume = false;  ///< go on with an interrupted run on the same store
  bool force = false;   ///< replace a store that exists (only when the new one is whole)
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Writes `store` once more at `out`, its bricks by another codec. All else stays as it is: levels,
/// bricks and shards, ranges, histogram, indices, and the metadata of the image, also what other
/// programs added to its attributes. No sample is computed anew. Files of others in the store and
/// label images in its group `labels` are not copied.
///
/// Works as convert() does: in `out` + ".partial", into a zip where `out` is named .zip or .ozx,
/// resumable by shard. Reads and writes brick by brick on all threads. Bricks are checked while
/// they are read: DamageError names the first one that is damaged.
///
/// Throws UsageError where `out` is the store that is read, where the budget is too small (naming
/// the least that does), for an image of another program, which convert() takes, and where
/// ConvertStaging does; Error where a store lacks ranges.
ISOBRICK_API ConvertReport recode(const StoreReader& store, const std::filesystem::path& out,
                                  const RecodeOptions& options, Progress& progress = no_progress());

/// Some bricks of level 0 as zstd of that level and as packed, on so many threads (0: all cores).
/// Reads some dozens of them, of any store.
ISOBRICK_API CodecSample sample_codecs(const StoreReader& store, int zstd_level = 3,
                                       int threads = 0);

}  // namespace isobrick

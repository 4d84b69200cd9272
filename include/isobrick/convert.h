#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/brick_codec.h>
#include <isobrick/downsampling.h>
#include <isobrick/image_metadata.h>
#include <isobrick/index_build.h>
#include <isobrick/part.h>
#include <isobrick/progress.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// How a store is written.
struct ConvertOptions {
  /// Samples along each edge of a brick, 16 … 256. Nothing: as many samples as a cube of 64 has, in
  /// bricks that follow the shape of a thin volume. No brick is much longer than the volume.
  std::optional<Index> brick = {};
  /// Samples along each edge of a shard, a multiple of `brick`. Nothing: the same with a cube of
  /// 512.
  std::optional<Index> shard = {};
  /// packed needs OME-Zarr 0.5; of 0.4 automatic is zstd. With automatic a stream is copied to a
  /// temporary file beside the store first, as large as its samples.
  BrickCodec codec = BrickCodec::zstd;
  int zstd_level = 3;                       ///< of zstd, 1 … 22
  double packed_factor = kMaxPackedFactor;  ///< of automatic: see kMaxPackedFactor
  std::optional<int> levels = {};           ///< nothing: until one brick holds the coarsest
  /// From a level to the next, 1 or 2 an axis: of each step in turn, the last one of all further
  /// steps. Nothing: factors_by_spacing().
  std::vector<Int3> factors = {};
  OmeVersion ome = OmeVersion::v05;  ///< 0.4 has no shards: `shard` does not matter
  /// How a level is made from the finer one. Nothing: by the mean; of a label image by the mode.
  std::optional<Downsampling> downsampling = {};
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  bool resume = false;  ///< go on with an interrupted conversion of the same input
  bool force = false;   ///< replace a store that exists (only when the new one is whole)
  std::vector<std::filesystem::path> inputs = {};  ///< never replaced, beside the source's files
  std::optional<IndexKind> index = {};             ///< also add one of this kind to all levels
  Index leaf = kDefaultLeaf;                       ///< of that index
  bool label_lists = false;                        ///< also add those of a label image
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
  /// Writes only this part of the finest level, to the folder `out` + ".parts": the work of one of
  /// several tasks. Its shards that are whole are kept. `resume`, `force` and `index` do not
  /// matter.
  std::optional<Part> part = {};
  /// Makes the store of so many parts that are all there, instead of reading samples; 0: reads
  /// them.
  std::uint32_t join = 0;
};

/// What a conversion did.
struct ConvertReport {
  std::uint64_t bytes_in = 0;       ///< bytes of the volume's samples
  std::uint64_t bytes_out = 0;      ///< bytes of the store's files
  std::uint64_t bricks = 0;         ///< bricks of all levels
  std::uint64_t bricks_absent = 0;  ///< of them, those that hold the fill value only
  std::uint64_t bricks_kept = 0;    ///< of them, those that resume found done
  int levels = 0;                   ///< resolutions of the store
  std::uint64_t index_bytes = 0;    ///< part of bytes_out
  double seconds = 0;               ///< wall time of the conversion, the index included
  double index_seconds = 0;         ///< wall time of the index
  std::string codec;                ///< of the bricks, as StoreInfo::codec
  /// What BrickCodec::automatic was chosen by. Nothing: the codec was given, OME-Zarr 0.4 left no
  /// choice, or a resume goes on with the codec of the interrupted conversion.
  std::optional<CodecSample> codec_sample = {};
};

/// Writes `source` as a store at `out`: works in `out` + ".partial" and renames
/// at the end. Where `out` is named .zip or .ozx it becomes a zip of the store, which needs room
/// for both while it is written. Reads each input sample once. Throws UsageError when the budget
/// is too small for one row of bricks (naming the least that does), and where
/// ConvertStaging does.
ISOBRICK_API ConvertReport convert(VolumeSource& source, const std::filesystem::path& out,
                                   const ConvertOptions& options,
                                   Progress& progress = no_progress());

}  // namespace isobrick

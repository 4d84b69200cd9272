#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/label_properties.h>
#include <isobrick/lattice.h>
#include <isobrick/level_info.h>
#include <isobrick/range_table.h>
#include <isobrick/sample_value.h>
#include <isobrick/selection.h>
#include <isobrick/storage.h>

namespace isobrick::inline v0 {

/// A store's metadata.
struct StoreInfo {
  std::string name;  ///< how messages name the store: that of its storage
  /// The key that ranges and indices are found below: empty, or that of a folder that belongs to
  /// one of several channels or times.
  std::string additions;
  Selection selection;               ///< as requested
  std::vector<LevelInfo> levels;     ///< the finest first
  ScalarType type = ScalarType::u8;  ///< of the samples as they are read
  /// Of the samples as StoreReader::native() reads them: the same but for 64-bit integers.
  ScalarType stored_type = ScalarType::u8;
  SampleValue fill_value;  ///< of absent bricks; exact for every type
  std::string grid_class;  ///< of the OpenVDB grid that it came from ("level set"), or empty
  std::string grid_name;   ///< of that grid, or empty
  std::optional<LabelTable> labels;  ///< as VolumeInfo::labels
  std::string codec;                 ///< "zstd:3" or "none"
  /// Whether level 0 may hold NaN (always false for integers).
  bool may_have_nan = false;
  bool ours = true;                   ///< false: an image that another program has written
  std::uint32_t metadata_crc32c = 0;  ///< metadata_checksum() of what was read
};

/// What a user types to have the ranges of such a store computed.
ISOBRICK_API std::string index_command(const StoreInfo& info);

/// The most that any level's decode_extra takes for so many threads.
ISOBRICK_API std::uint64_t decode_extra(const StoreInfo& info, int threads);

/// Where a brick lies in the storage of its store.
struct BrickLocation {
  std::string key;           ///< of the shard or chunk
  std::uint64_t offset = 0;  ///< of the encoded brick in that object, bytes
  std::uint64_t size = 0;    ///< of the encoded brick, bytes
};

/// What reading bricks has cost so far, summed over threads.
struct ISOBRICK_API BrickTimes {
  double read_seconds = 0;          ///< time of reading
  double decode_seconds = 0;        ///< time of checking and decoding
  std::uint64_t bytes_read = 0;     ///< encoded bytes
  std::uint64_t bytes_decoded = 0;  ///< decoded bytes

  /// Whether reads come from memory, going by their speed: then hints to the disk (will_need)
  /// gain nothing, and each is a call of the system.
  bool from_memory() const {
    constexpr double max_seconds_per_byte = 1e-9;
    return bytes_read > 0 && read_seconds < max_seconds_per_byte * static_cast<double>(bytes_read);
  }
};

/// Reads a store, or an image or array that another program has written as Zarr
/// version 2 or 3. Thread-safe after construction; keeps shard indices cached
/// in bounded memory, never samples.
///
/// 64-bit integers are read as f64, which surfaces are made of; an integer that no f64 is throws
/// Error. native() reads them as they are.
class ISOBRICK_API StoreReader {
 public:
  /// Opens the store in a folder or in a zip, as open_storage() does.
  explicit StoreReader(const std::filesystem::path& path, const Selection& selection = {});
  /// Throws Error when there is no store, one of an unknown version, or one that
  /// lacks what is needed; DamageError when its metadata is broken; UsageError
  /// when the selection leaves open which volume is meant, or means none.
  explicit StoreReader(std::shared_ptr<const Storage> storage, const Selection& selection = {});
  ~StoreReader();

  /// The same store, whose 64-bit integers are read as they are: for labels and for copies. Ranges
  /// stay f64 (surface_type()): the nearest one of an item that has one value, else those below
  /// and above. Shares what is cached and counted.
  StoreReader native() const;

  /// The metadata. Valid as long as the reader.
  const StoreInfo& info() const;
  /// Where the store is read from.
  const std::shared_ptr<const Storage>& storage() const;

  /// Where brick `b` is, or nothing when it is absent (all fill value).
  std::optional<BrickLocation> locate(int level, Int3 b) const;

  /// The key of the shard or chunk that brick `b` belongs to, whether it is there or not. Reads
  /// nothing.
  std::string key_of(int level, Int3 b) const;

  /// Reads, checks and decodes brick `b` into `out` (lattice.brick_bytes(),
  /// native byte order). False when the brick is absent; `out` is untouched then.
  /// Throws DamageError naming level, brick, file and offset, also for a whole brick that is not
  /// the one that the store's checksums are of: it is that of another place or store.
  bool read_brick(int level, Int3 b, std::byte* out) const;
  /// The same without comparing it with the store's checksums: for computing them. The brick's
  /// checksum; nullopt when it is absent.
  std::optional<std::uint32_t> read_brick_unchecked(int level, Int3 b, std::byte* out) const;

  /// Whether the bricks of a level are packed (BrickCodec::packed) samples of the type that this
  /// reader gives.
  bool is_packed(int level) const;
  /// Reads and checks brick `b` of such a level as it is stored, without the checksum at its end,
  /// to the beginning of `out`, which has room for the checksum as well. How many bytes; nullopt
  /// when it is absent. Throws as read_brick() for all that shows without decoding.
  std::optional<std::size_t> read_packed(int level, Int3 b, std::span<std::byte> out) const;

  /// Hints that brick `b` is read soon, as StoredObject::will_need(). Finds the brick first: reads
  /// its shard's index where that is not cached, and throws as read_brick() does for its place.
  void will_need(int level, Int3 b) const;
  /// The same of several bricks. Where requests take long, those of different shards overlap.
  void will_need(int level, std::span<const Int3> bricks) const;
  /// Whether these hints gain nothing: BrickTimes::from_memory() of objects on this machine.
  bool reads_memory() const;

  /// Bytes read from the storage so far (bricks, indices, ranges).
  std::uint64_t bytes_read() const;
  /// The bricks among it.
  BrickTimes brick_times() const;

  /// Whether the level has both kinds of ranges, and checksums of its bricks. Without them no
  /// surface can be extracted; `isobrick index` adds them. Throws UsageError for no such level.
  bool has_ranges(int level) const;

  /// Edge, in blocks, of the chunks in which block ranges are stored: reading
  /// an aligned cube of them touches one file.
  static constexpr Index kRangeChunk = kRangeChunkEdge;

  /// Ranges of the bricks in `box` (in bricks). Throws Error when the store has no ranges yet.
  RangeTable brick_ranges(int level, Box3 box) const;
  /// Ranges of the blocks of 16³ cells in `box` (in blocks). Throws as brick_ranges() does.
  RangeTable block_ranges(int level, Box3 box) const;

 private:
  struct Impl;
  StoreReader(std::shared_ptr<Impl> impl, bool is_native);

  std::shared_ptr<Impl> impl_;
  bool is_native_ = false;
};

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/level_info.h>
#include <isobrick/part.h>
#include "bricks/ranges/stored_histogram.h"
#include "io/bytes/file.h"
#include "io/bytes/output_file.h"

// What a part of an index leaves of the ranges of a store that lacks them: those of the blocks and
// bricks that its samples touch, which its neighbours' samples may touch too; checksums of its
// bricks; and counts of its samples of level 0.

namespace isobrick::inline v0 {

/// Some items of one level.
struct PartRecord {
  enum class Kind : std::uint32_t { blocks, bricks, checksums };
  Kind kind = Kind::blocks;
  std::int32_t level = 0;
  Box3 items;                           ///< blocks or bricks, of one layer
  Index z1 = 0;                         ///< all samples of the part below it are in its ranges
  std::uint64_t offset = 0, bytes = 0;  ///< in the file
};

/// What has a fixed size: the end of the file.
struct PartRangesEnd {
  static constexpr std::uint64_t kMagic = 0x31'74'72'61'70'6f'73'69;  // "isopart1"
  std::uint64_t magic = kMagic;
  Part part;
  HistogramBins bins;
  std::uint64_t counts_offset = 0;
  std::uint64_t records = 0;  ///< their number; they follow the counts
  std::uint64_t bytes = 0;    ///< of the file
  std::uint32_t has_nan = 0;
  std::uint32_t state = 0;           ///< IndexParts::ranges_state()
  std::uint32_t content_crc32c = 0;  ///< of all bytes before the end
  std::uint32_t own_crc32c = 0;      ///< of the end, but for itself
};

/// Writes such a file.
class PartRangesWriter {
 public:
  PartRangesWriter(const std::filesystem::path& path, Part part, std::uint32_t state);

  void append(PartRecord record, std::span<const std::byte> bytes);
  /// Ends the file, which then has its name.
  void finish(const SampleCounts& counts, bool has_nan);

 private:
  void write(std::span<const std::byte> bytes);

  OutputFile out_;
  PartRangesEnd end_;
  std::vector<PartRecord> records_;
};

/// Reads such a file.
class PartRangesReader {
 public:
  /// nullopt where there is no whole file of this part and state, whose items are of `levels`.
  /// `verify`: reads all of it.
  static std::optional<PartRangesReader> open(const std::filesystem::path& path, Part part,
                                              std::uint32_t state,
                                              std::span<const LevelInfo> levels, bool verify);

  /// In the order in which they were appended.
  const std::vector<PartRecord>& records() const { return records_; }
  std::vector<std::byte> read(const PartRecord& record) const;
  SampleCounts counts() const;
  bool has_nan() const { return end_.has_nan != 0; }

 private:
  PartRangesReader(File file, const PartRangesEnd& end) : file_(std::move(file)), end_(end) {}
  bool read_records(std::span<const LevelInfo> levels);
  bool is_whole() const;

  File file_;
  PartRangesEnd end_;
  std::vector<PartRecord> records_;
};

}  // namespace isobrick

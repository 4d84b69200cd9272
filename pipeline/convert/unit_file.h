#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include "bricks/ranges/stored_histogram.h"
#include "io/bytes/file.h"
#include "io/bytes/output_file.h"

// What a part of a conversion leaves of a unit, beside its shards: all that the rest of the store
// is made of. A unit is a box of whole shards of level 0.

namespace isobrick::inline v0 {

/// Of a unit, what has a fixed size: the end of its file.
struct UnitEnd {
  static constexpr std::uint64_t kMagic = 0x31'74'69'6e'75'6f'73'69;  // "isounit1"
  std::uint64_t magic = kMagic;
  Box3 box;  ///< its samples
  std::uint64_t bricks = 0, absent = 0;
  std::uint64_t coarse_bytes = 0;                  ///< samples of the next level
  std::uint64_t block_bytes = 0, brick_bytes = 0;  ///< ranges
  std::uint64_t shards = 0;
  HistogramBins bins;
  std::uint64_t bytes = 0;  ///< of the file
  std::uint32_t has_nan = 0;
  std::uint32_t samples_crc32c = 0;  ///< of what was read of the input, slab by slab
  std::uint32_t unused = 0;
  std::uint32_t layout_crc32c = 0;   ///< of the layout's marker
  std::uint32_t content_crc32c = 0;  ///< of all bytes before the end
  std::uint32_t own_crc32c = 0;      ///< of the end, but for itself
};

/// What is known of a unit when all of its samples were read.
struct UnitContent {
  std::span<const std::byte> block_ranges, brick_ranges;
  SampleCounts counts;
  std::vector<std::uint8_t> has_bricks;  ///< of each shard: whether it has a file
  bool has_nan = false;
  std::uint32_t samples_crc32c = 0;
  std::uint64_t bricks = 0, absent = 0;
};

/// Writes such a file. First come the samples of the next level, in the order of z.
class UnitWriter {
 public:
  UnitWriter(const std::filesystem::path& path, std::uint32_t layout_crc32c, Box3 box);

  void append_coarse(std::span<const std::byte> samples);
  /// Ends the file, which then has its name.
  void finish(const UnitContent& content);

 private:
  void append(std::span<const std::byte> bytes);

  OutputFile out_;
  UnitEnd end_;
};

/// Reads such a file.
class UnitReader {
 public:
  /// Nothing where there is no whole file of this layout and box. `verify`: reads all of it.
  static std::optional<UnitReader> open(const std::filesystem::path& path,
                                        std::uint32_t layout_crc32c, Box3 box, bool verify);

  const UnitEnd& end() const { return end_; }
  std::vector<std::byte> block_ranges() const;
  std::vector<std::byte> brick_ranges() const;
  std::vector<std::uint8_t> has_bricks() const;
  SampleCounts counts() const;
  /// Bytes of the samples of the next level, from `offset` on.
  void read_coarse(std::uint64_t offset, std::span<std::byte> out) const {
    file_.read_at(offset, out);
  }

 private:
  UnitReader(File file, const UnitEnd& end) : file_(std::move(file)), end_(end) {}
  bool is_whole() const;
  std::vector<std::byte> read(std::uint64_t offset, std::uint64_t size) const;

  File file_;
  UnitEnd end_;
};

}  // namespace isobrick

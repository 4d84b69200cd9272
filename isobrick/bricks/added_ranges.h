#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isobrick {

/// The checksums of a level's range arrays, as RangeArrayWriter::finish() gives them.
struct RangeChecksums {
  std::uint32_t bricks = 0, blocks = 0;
  friend bool operator==(const RangeChecksums&, const RangeChecksums&) = default;
};

/// What a store's ranges are those of: isobrick/ranges.json. The metadata of images that others
/// have written is left as it is.
struct AddedRanges {
  bool may_have_nan = true;
  /// metadata_checksum() of the image that the ranges were computed from.
  std::uint32_t image_crc32c = 0;
  std::vector<RangeChecksums> levels;

  friend bool operator==(const AddedRanges&, const AddedRanges&) = default;
};

std::filesystem::path added_ranges_file(const std::filesystem::path& store);

std::string to_json(const AddedRanges& added);

/// Reads ranges.json of a store; nothing when there is none. DamageError for
/// what is broken, Error for a version that this program does not know.
std::optional<AddedRanges> read_added_ranges(const std::filesystem::path& store);

}  // namespace isobrick

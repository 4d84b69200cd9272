#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bricks/ranges/stored_histogram.h"

namespace isobrick::inline v0 {

/// The checksums of a level's arrays of ranges and of its bricks' checksums, as
/// ItemArrayWriter::finish() gives them.
struct RangeChecksums {
  std::uint32_t bricks = 0, blocks = 0, content = 0;
  friend bool operator==(const RangeChecksums&, const RangeChecksums&) = default;
};

/// Which image the ranges in a store belong to, and their checksums: isobrick/ranges.json. The
/// metadata of images of other programs stays as it is.
struct StoredRanges {
  bool may_have_nan = true;
  /// metadata_checksum() of the image that the ranges were computed from.
  std::uint32_t image_crc32c = 0;
  std::vector<RangeChecksums> levels;
  /// Of level 0; nullopt: none is kept.
  std::optional<StoredHistogram> histogram = std::nullopt;

  friend bool operator==(const StoredRanges&, const StoredRanges&) = default;
};

/// Where it lies in a store, below `additions`: both are keys.
std::string ranges_file(const std::string& additions);

/// The text of ranges.json.
std::string to_json(const StoredRanges& stored);

/// Reads the text of ranges.json; `where` names the file. DamageError for what is broken, Error for
/// a version that this program does not know.
StoredRanges parse_stored_ranges(std::string_view text, const std::string& where);

/// Reads it; nullopt when there is none. Throws as parse_stored_ranges() does.
std::optional<StoredRanges> read_stored_ranges(const Storage& storage,
                                               const std::string& additions);

}  // namespace isobrick

#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/sample_value.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include "bricks/zarr/codec.h"
#include "core/wide_type.h"

namespace isobrick::inline v0 {

/// The zarr.json of an array, as far as we read and write it. Lists are in
/// Zarr's order: z, y, x.
struct ArrayMetadata {
  /// The sharding_indexed codec. Without it a chunk is a file.
  struct Sharding {
    std::vector<Index> brick;  ///< the inner chunk
    bool index_at_end = true;
    bool index_has_crc = true;
    friend bool operator==(const Sharding&, const Sharding&) = default;
  };

  std::vector<Index> shape;
  std::vector<Index> chunk;  ///< of the regular grid: a shard, if there are shards
  ScalarType type = ScalarType::u8;
  std::optional<WideType> wide;  ///< what is stored, where that is none of our types
  SampleValue fill_value;
  CodecChain codecs;  ///< of a chunk, or of a brick if there are shards
  std::optional<Sharding> sharding;
  bool key_prefix = true;  ///< keys begin with "c"
  char separator = '/';
  std::vector<std::string> dimension_names;

  friend bool operator==(const ArrayMetadata&, const ArrayMetadata&) = default;

  /// What is encoded by itself: the inner chunk of a shard, or a chunk.
  const std::vector<Index>& brick() const { return sharding ? sharding->brick : chunk; }
  /// Of a sample as it is stored.
  std::size_t stored_bytes() const { return wide ? size_of(*wide) : size_of(type); }
  /// File of a chunk relative to the array's folder: "c/z/y/x".
  std::string chunk_key(std::span<const Index> chunk_coordinates) const;
};

/// The text of zarr.json for an array of our own making.
std::string to_json(const ArrayMetadata& array);

/// Reads zarr.json; `where` names the file. DamageError for what is no valid
/// Zarr, Error for what is valid but not supported, naming it. Afterwards shape
/// and chunks are positive, bricks divide shards, and a decoded chunk or brick
/// and a shard's index have at most kMaxBrickBytes.
ArrayMetadata parse_array_metadata(std::string_view text, const std::string& where);

/// The text of zarr.json for a group without attributes.
std::string group_json();

}  // namespace isobrick

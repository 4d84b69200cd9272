#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// The low 64 bits of MurmurHash3_x86_128 of a number's eight bytes, with the seed 0.
std::uint64_t murmur_hash(std::uint64_t number);

/// How segments are distributed (neuroglancer_uint64_sharded_v1, with murmur_hash).
struct ShardBits {
  int minishard = 0, shard = 0;
};

/// So that a file has about half a gibibyte, and an index a few hundred segments.
ShardBits choose_shard_bits(std::uint64_t segments, std::uint64_t bytes);

/// Where a segment's bytes are before they are in a shard: its fragments, then its manifest.
struct ShardEntry {
  std::uint64_t offset = 0, fragment_bytes = 0, manifest_bytes = 0;
};

/// Writes the shards of all segments, whose bytes `from` has, into a folder. Returns the bytes of
/// the files.
std::uint64_t write_shards(const std::filesystem::path& folder, FileWriter& from,
                           const std::map<std::uint64_t, ShardEntry>& entries, ShardBits bits);

}  // namespace isobrick

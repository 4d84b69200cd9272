#include "io/meshes/levels/shard_files.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <vector>

#include <fmt/format.h>

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr std::uint64_t kShardBytes = std::uint64_t{512} << 20;
constexpr std::uint64_t kMinishardSegments = 512;
constexpr int kMaxBits = 16;

std::uint32_t mixed(std::uint32_t h) {
  h ^= h >> 16;
  h *= 0x85ebca6b;
  h ^= h >> 13;
  h *= 0xc2b2ae35;
  return h ^ h >> 16;
}

/// The smallest number of bits for `count` things.
int bits_for(std::uint64_t count) {
  return std::clamp(static_cast<int>(std::bit_width(std::max<std::uint64_t>(1, count) - 1)), 0,
                    kMaxBits);
}

std::string_view bytes_of(const std::vector<std::uint64_t>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(std::uint64_t)};
}

/// A segment of a minishard and where its manifest begins, from the end of the shard's index.
struct Placed {
  std::uint64_t id, begin, bytes;
};

/// Identifiers, places and sizes, each as the difference to the one before.
std::vector<std::uint64_t> minishard_index(const std::vector<Placed>& placed) {
  std::vector<std::uint64_t> index;
  std::uint64_t id = 0, end = 0;
  for (const Placed& p : placed) {
    index.push_back(p.id - id);
    id = p.id;
  }
  for (const Placed& p : placed) {
    index.push_back(p.begin - end);
    end = p.begin + p.bytes;
  }
  for (const Placed& p : placed) index.push_back(p.bytes);
  return index;
}

/// The segments of a shard by minishard.
using Minishards = std::vector<std::vector<std::uint64_t>>;

std::uint64_t write_shard(const std::string& path, FileWriter& from,
                          const std::map<std::uint64_t, ShardEntry>& entries,
                          const Minishards& minishards) {
  OutputFile file(path, false);
  FileWriter& out = file.writer();
  std::vector<std::uint64_t> index(2 * minishards.size(), 0);
  const std::uint64_t data = index.size() * sizeof(std::uint64_t);
  out.append(bytes_of(index));
  std::vector<std::vector<Placed>> placed(minishards.size());
  for (std::size_t i = 0; i < minishards.size(); ++i)
    for (const std::uint64_t id : minishards[i]) {
      const ShardEntry& entry = entries.at(id);
      out.append_range(from, entry.offset, entry.fragment_bytes + entry.manifest_bytes);
      placed[i].push_back({id, out.size() - data - entry.manifest_bytes, entry.manifest_bytes});
    }
  for (std::size_t i = 0; i < minishards.size(); ++i) {
    index[2 * i] = out.size() - data;
    if (!placed[i].empty()) out.append(bytes_of(minishard_index(placed[i])));
    index[2 * i + 1] = out.size() - data;
  }
  out.patch(0, bytes_of(index));
  const std::uint64_t bytes = out.size();
  file.publish();
  return bytes;
}

}  // namespace

std::uint64_t murmur_hash(std::uint64_t number) {
  // Of eight bytes: no whole block, and a tail of two words.
  constexpr std::uint32_t c1 = 0x239b961b, c2 = 0xab0e9789, c3 = 0x38b34ae5;
  const auto low = static_cast<std::uint32_t>(number);
  const auto high = static_cast<std::uint32_t>(number >> 32);
  std::uint32_t h1 = std::rotl(low * c1, 15) * c2, h2 = std::rotl(high * c2, 16) * c3, h3 = 0,
                h4 = 0;
  constexpr std::uint32_t length = 8;
  h1 ^= length, h2 ^= length, h3 ^= length, h4 ^= length;
  h1 += h2 + h3 + h4;
  h2 += h1, h3 += h1, h4 += h1;
  h1 = mixed(h1), h2 = mixed(h2), h3 = mixed(h3), h4 = mixed(h4);
  h1 += h2 + h3 + h4;
  h2 += h1;
  return h1 | std::uint64_t{h2} << 32;
}

ShardBits choose_shard_bits(std::uint64_t segments, std::uint64_t bytes) {
  ShardBits bits;
  bits.shard = bits_for(bytes / kShardBytes + 1);
  bits.minishard = bits_for((segments >> bits.shard) / kMinishardSegments + 1);
  return bits;
}

std::uint64_t write_shards(const std::filesystem::path& folder, FileWriter& from,
                           const std::map<std::uint64_t, ShardEntry>& entries, ShardBits bits) {
  const std::uint64_t minishards = std::uint64_t{1} << bits.minishard;
  std::map<std::uint64_t, Minishards> shards;
  for (const auto& [id, entry] : entries) {
    const std::uint64_t hash = murmur_hash(id);
    const std::uint64_t shard = hash >> bits.minishard & ((std::uint64_t{1} << bits.shard) - 1);
    Minishards& of_shard = shards[shard];
    of_shard.resize(static_cast<std::size_t>(minishards));
    of_shard[static_cast<std::size_t>(hash & (minishards - 1))].push_back(id);
  }
  std::uint64_t bytes = 0;
  const int digits = std::max(1, (bits.shard + 3) / 4);
  for (const auto& [shard, of_shard] : shards) {
    const std::string name = fmt::format("{:0{}x}.shard", shard, digits);
    bytes += write_shard((folder / name).string(), from, entries, of_shard);
  }
  return bytes;
}

}  // namespace isobrick

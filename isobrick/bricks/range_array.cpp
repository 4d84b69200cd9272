#include "isobrick/bricks/range_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/codec.h"
#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

constexpr Index kEdge = StoreReader::kRangeChunk;
constexpr Int3 kChunk{kEdge, kEdge, kEdge};
constexpr int kRangeZstdLevel = 3;
// Four gigabytes of ranges: a store that claims to have more must be read in parts.
constexpr Index kMaxItemsAtOnce = Index{1} << 28;

std::filesystem::path chunk_path(const std::filesystem::path& folder, const ArrayMetadata& metadata,
                                 Int3 c) {
  return folder / metadata.chunk_key(std::array<Index, 4>{c.z, c.y, c.x, 0});
}

std::filesystem::path checksums_file(const std::filesystem::path& folder) {
  return folder / "checksums";
}

/// The last that an encoded chunk holds. The checksum of all of it would always be the same.
std::uint32_t stored_checksum(std::span<const std::byte> encoded) {
  std::uint32_t crc = 0;
  if (encoded.size() >= sizeof crc) std::memcpy(&crc, encoded.last(sizeof crc).data(), sizeof crc);
  return crc;
}

std::size_t chunk_bytes(ScalarType type) {
  return static_cast<std::size_t>(volume(kChunk)) * 2 * size_of(type);
}

void check_box(Box3 box, Int3 items) {
  if (box.empty() || intersect(box, {{0, 0, 0}, items}) != box)
    throw UsageError("ranges were asked for or given outside of the volume");
}

// Calls f(chunk coordinates, the part of the box in that chunk).
template <class F>
void for_each_chunk(Box3 box, F&& f) {
  const Int3 first{box.lo.x / kEdge, box.lo.y / kEdge, box.lo.z / kEdge};
  for_each_point({first, ceil_div(box.hi, kChunk)}, [&](Int3 c) {
    f(c, intersect(box, {c * kChunk, (c + Int3{1, 1, 1}) * kChunk}));
  });
}

}  // namespace

std::filesystem::path brick_range_folder(const std::filesystem::path& store, int level) {
  return store / "isobrick" / std::to_string(level) / "range";
}

std::filesystem::path block_range_folder(const std::filesystem::path& store, int level) {
  return store / "isobrick" / std::to_string(level) / "block_range";
}

ArrayMetadata range_array_metadata(Int3 items, ScalarType type) {
  ArrayMetadata metadata;
  metadata.shape = {items.z, items.y, items.x, 2};
  metadata.chunk = {kEdge, kEdge, kEdge, 2};
  metadata.type = type;
  metadata.codecs = CodecChain::ours(kRangeZstdLevel);
  metadata.dimension_names = {"z", "y", "x", "bound"};
  return metadata;
}

RangeArrayWriter::RangeArrayWriter(std::filesystem::path folder, Int3 items, ScalarType type,
                                   Publisher& publisher)
    : folder_(std::move(folder)),
      items_(items),
      metadata_(range_array_metadata(items, type)),
      publisher_(publisher),
      checksums_(static_cast<std::size_t>(volume(ceil_div(items, kChunk)))) {}

void RangeArrayWriter::put(Box3 box, std::span<const std::byte> pairs) {
  check_box(box, items_);
  const std::size_t pair = 2 * size_of(metadata_.type);
  if (pairs.size() != static_cast<std::size_t>(volume(box.extent())) * pair)
    throw UsageError("ranges of the wrong size were given");
  for_each_chunk(box, [&](Int3 c, Box3 part) {
    const Box3 whole = intersect({c * kChunk, (c + Int3{1, 1, 1}) * kChunk}, {{0, 0, 0}, items_});
    const auto key = std::tuple(c.z, c.y, c.x);
    Chunk complete;
    {
      const std::lock_guard lock(mutex_);
      Chunk& chunk = chunks_[key];
      if (chunk.bytes.empty()) {
        chunk.bytes.resize(chunk_bytes(metadata_.type));
        chunk.missing = volume(whole.extent());
      }
      const std::size_t row = static_cast<std::size_t>(part.extent().x) * pair;
      for (Index z = part.lo.z; z < part.hi.z; ++z)
        for (Index y = part.lo.y; y < part.hi.y; ++y) {
          const Int3 p{part.lo.x, y, z};
          const auto to = static_cast<std::size_t>(linear_index(p - c * kChunk, kChunk)) * pair;
          const auto from = static_cast<std::size_t>(linear_index(p - box.lo, box.extent())) * pair;
          std::memcpy(chunk.bytes.data() + to, pairs.data() + from, row);
        }
      chunk.missing -= volume(part.extent());
      if (chunk.missing > 0) return;
      complete = std::move(chunk);
      chunks_.erase(key);
      ++written_;
    }
    write_chunk(c, complete);
  });
}

void RangeArrayWriter::write_chunk(Int3 c, const Chunk& chunk) {
  const std::vector<std::byte> encoded = encode_bytes(metadata_.codecs, chunk.bytes);
  // Each chunk is written once, so that nobody else has this place.
  checksums_[static_cast<std::size_t>(linear_index(c, ceil_div(items_, kChunk)))] =
      stored_checksum(encoded);
  publisher_.write(chunk_path(folder_, metadata_, c), encoded);
}

std::optional<std::uint32_t> RangeArrayWriter::finish() {
  const std::lock_guard lock(mutex_);
  if (written_ == 0 && chunks_.empty()) return std::nullopt;
  if (!chunks_.empty() || written_ != volume(ceil_div(items_, kChunk)))
    throw Error(fmt::format("'{}': only some of the ranges were given", folder_.string()));
  std::vector<std::uint32_t> all = checksums_;
  all.push_back(crc32c(std::as_bytes(std::span(checksums_))));
  publisher_.write(checksums_file(folder_), std::as_bytes(std::span(all)));
  publisher_.write(folder_ / "zarr.json", to_json(metadata_));
  return all.back();
}

RangeArrayReader::RangeArrayReader(std::filesystem::path folder, Int3 items, ScalarType type,
                                   std::uint32_t crc32c)
    : folder_(std::move(folder)), items_(items) {
  const std::filesystem::path file = folder_ / "zarr.json";
  const auto text = read_small_file(file, kMaxMetadataBytes);
  if (!text) throw Error(fmt::format("the store has no ranges: there is no '{}'", file.string()));
  const std::string where = quoted(file);
  metadata_ = parse_array_metadata(*text, where);
  const ArrayMetadata expected = range_array_metadata(items, type);
  if (metadata_.shape != expected.shape || metadata_.chunk != expected.chunk ||
      metadata_.type != expected.type || metadata_.sharding)
    throw DamageError(where + ": shape, chunks or type are not those of this level's ranges");
  read_checksums(crc32c);
}

/// Reading ranges reports what is wrong here: a caller can compute them anew.
void RangeArrayReader::read_checksums(std::uint32_t expected) {
  const std::filesystem::path file = checksums_file(folder_);
  const auto count = static_cast<std::size_t>(volume(ceil_div(items_, kChunk)));
  const std::size_t bytes = (count + 1) * sizeof(std::uint32_t);
  const auto text = read_small_file(file, bytes);
  if (!text) {
    wrong_ = fmt::format("'{}' is missing", file.string());
    return;
  }
  const std::string damaged = fmt::format("'{}' is damaged", file.string());
  if (text->size() != bytes) {
    wrong_ = damaged;
    return;
  }
  std::vector<std::uint32_t> all(count + 1);
  std::memcpy(all.data(), text->data(), bytes);
  const std::uint32_t last = all.back();
  all.pop_back();
  if (crc32c(std::as_bytes(std::span(all))) != last)
    wrong_ = damaged;
  else if (last != expected)
    wrong_ = fmt::format("'{}' is that of another level or store", file.string());
  checksums_ = std::move(all);
}

RangeTable RangeArrayReader::read(Box3 box, std::atomic<std::uint64_t>& bytes_read) const {
  check_box(box, items_);
  if (!wrong_.empty()) throw DamageError(wrong_);
  if (volume(box.extent()) > kMaxItemsAtOnce)
    throw Error(fmt::format("'{}': {} ranges are too many at once", folder_.string(),
                            volume(box.extent())));
  RangeTable table{box, {}};
  table.ranges.resize(static_cast<std::size_t>(volume(box.extent())));
  const std::size_t size = chunk_bytes(metadata_.type);
  std::vector<std::byte> decoded(size);
  for_each_chunk(box, [&](Int3 c, Box3 part) {
    const std::filesystem::path path = chunk_path(folder_, metadata_, c);
    const auto content = read_small_file(path, 2 * size + 1024);
    // Chunks are written even where all ranges are alike, so none may be missing.
    if (!content) throw DamageError(fmt::format("'{}' is missing", path.string()));
    const auto encoded = std::as_bytes(std::span(*content));
    bytes_read += encoded.size();
    table.bytes_read += encoded.size();
    try {
      decode_bytes(metadata_.codecs, size_of(metadata_.type), encoded, decoded);
    } catch (const DamageError& e) {
      throw DamageError(fmt::format("'{}': {}", path.string(), e.what()));
    }
    if (stored_checksum(encoded) !=
        checksums_[static_cast<std::size_t>(linear_index(c, ceil_div(items_, kChunk)))])
      throw DamageError(
          fmt::format("'{}' is the chunk of another place, level or store", path.string()));
    visit_scalar(metadata_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      for (Index z = part.lo.z; z < part.hi.z; ++z)
        for (Index y = part.lo.y; y < part.hi.y; ++y) {
          const Int3 p{part.lo.x, y, z};
          const std::byte* from =
              decoded.data() +
              static_cast<std::size_t>(linear_index(p - c * kChunk, kChunk)) * 2 * sizeof(T);
          auto* to = table.ranges.data() + linear_index(p - box.lo, box.extent());
          for (Index x = 0; x < part.extent().x; ++x, ++to, from += 2 * sizeof(T)) {
            T pair[2];
            std::memcpy(pair, from, sizeof pair);
            *to = {static_cast<double>(pair[0]), static_cast<double>(pair[1])};
          }
        }
    });
  });
  return table;
}

}  // namespace isobrick

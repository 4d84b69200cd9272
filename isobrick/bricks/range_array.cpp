#include "isobrick/bricks/range_array.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/codec.h"
#include "isobrick/bricks/range_format.h"
#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

// Four gigabytes of ranges: a store that claims to have more must be read in parts.
constexpr Index kMaxItemsAtOnce = Index{1} << 28;

std::filesystem::path chunk_path(const std::filesystem::path& folder, const ArrayMetadata& metadata,
                                 Int3 c) {
  return folder / metadata.chunk_key(std::array<Index, 4>{c.z, c.y, c.x, 0});
}

std::filesystem::path checksums_file(const std::filesystem::path& folder) {
  return folder / "checksums";
}

void check_box(Box3 box, Int3 items) {
  if (box.empty() || intersect(box, {{0, 0, 0}, items}) != box)
    throw UsageError("ranges were asked for or given outside of the volume");
}

}  // namespace

std::filesystem::path brick_range_folder(const std::filesystem::path& store, int level) {
  return store / "isobrick" / std::to_string(level) / "range";
}

std::filesystem::path block_range_folder(const std::filesystem::path& store, int level) {
  return store / "isobrick" / std::to_string(level) / "block_range";
}

RangeArrayWriter::RangeArrayWriter(std::filesystem::path folder, Int3 items, ScalarType type,
                                   Publisher& publisher)
    : folder_(std::move(folder)),
      items_(items),
      metadata_(range_array_metadata(items, type)),
      publisher_(publisher),
      checksums_(static_cast<std::size_t>(volume(ceil_div(items, kRangeChunkExtent)))) {}

void RangeArrayWriter::put(Box3 box, std::span<const std::byte> pairs) {
  check_box(box, items_);
  if (pairs.size() != static_cast<std::size_t>(volume(box.extent())) * 2 * size_of(metadata_.type))
    throw UsageError("ranges of the wrong size were given");
  for_each_range_chunk(box, [&](Int3 c, Box3 part) {
    const Box3 whole = intersect({c * kRangeChunkEdge, (c + Int3{1, 1, 1}) * kRangeChunkEdge},
                                 {{0, 0, 0}, items_});
    const auto key = std::tuple(c.z, c.y, c.x);
    Chunk complete;
    {
      const std::lock_guard lock(mutex_);
      Chunk& chunk = chunks_[key];
      if (chunk.bytes.empty()) {
        chunk.bytes.resize(range_chunk_bytes(metadata_.type));
        chunk.missing = volume(whole.extent());
      }
      pack_ranges(metadata_.type, box, pairs, c, part, chunk.bytes);
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
  checksums_[static_cast<std::size_t>(linear_index(c, ceil_div(items_, kRangeChunkExtent)))] =
      range_chunk_checksum(encoded);
  publisher_.write(chunk_path(folder_, metadata_, c), encoded);
}

std::optional<std::uint32_t> RangeArrayWriter::finish() {
  const std::lock_guard lock(mutex_);
  if (written_ == 0 && chunks_.empty()) return std::nullopt;
  if (!chunks_.empty() || written_ != volume(ceil_div(items_, kRangeChunkExtent)))
    throw Error(fmt::format("'{}': only some of the ranges were given", folder_.string()));
  const std::vector<std::uint32_t> all = with_own_checksum(checksums_);
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
  const auto count = static_cast<std::size_t>(volume(ceil_div(items_, kRangeChunkExtent)));
  const std::size_t bytes = (count + 1) * sizeof(std::uint32_t);
  const auto text = read_small_file(file, bytes);
  auto read = text ? parse_range_checksums(std::as_bytes(std::span(*text)), count) : std::nullopt;
  if (!read) {
    wrong_ = fmt::format("'{}' is {}", file.string(), text ? "damaged" : "missing");
    return;
  }
  if (read->own != expected)
    wrong_ = fmt::format("'{}' is that of another level or store", file.string());
  checksums_ = std::move(read->chunks);
}

RangeTable RangeArrayReader::read(Box3 box, std::atomic<std::uint64_t>& bytes_read) const {
  check_box(box, items_);
  if (!wrong_.empty()) throw DamageError(wrong_);
  if (volume(box.extent()) > kMaxItemsAtOnce)
    throw Error(fmt::format("'{}': {} ranges are too many at once", folder_.string(),
                            volume(box.extent())));
  RangeTable table{box, {}};
  table.ranges.resize(static_cast<std::size_t>(volume(box.extent())));
  const std::size_t size = range_chunk_bytes(metadata_.type);
  std::vector<std::byte> decoded(size);
  for_each_range_chunk(box, [&](Int3 c, Box3 part) {
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
    if (range_chunk_checksum(encoded) !=
        checksums_[static_cast<std::size_t>(linear_index(c, ceil_div(items_, kRangeChunkExtent)))])
      throw DamageError(
          fmt::format("'{}' is the chunk of another place, level or store", path.string()));
    unpack_ranges(metadata_.type, decoded, c, part, table);
  });
  return table;
}

}  // namespace isobrick

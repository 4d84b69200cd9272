#include "isobrick/bricks/range_format.h"

#include <cstring>

#include "isobrick/bricks/codec.h"

namespace isobrick {
namespace {

constexpr int kRangeZstdLevel = 3;

/// Calls f(byte offset in the chunk, item in the box, items) for each row of `part`.
template <class F>
void for_each_row(Box3 box, Int3 chunk, Box3 part, std::size_t pair_bytes, const F& f) {
  for (Index z = part.lo.z; z < part.hi.z; ++z)
    for (Index y = part.lo.y; y < part.hi.y; ++y) {
      const Int3 p{part.lo.x, y, z};
      f(static_cast<std::size_t>(linear_index(p - chunk * kRangeChunkEdge, kRangeChunkExtent)) *
            pair_bytes,
        static_cast<std::size_t>(linear_index(p - box.lo, box.extent())),
        static_cast<std::size_t>(part.extent().x));
    }
}

}  // namespace

ArrayMetadata range_array_metadata(Int3 items, ScalarType type) {
  ArrayMetadata metadata;
  metadata.shape = {items.z, items.y, items.x, 2};
  metadata.chunk = {kRangeChunkEdge, kRangeChunkEdge, kRangeChunkEdge, 2};
  metadata.type = type;
  metadata.codecs = CodecChain::ours(kRangeZstdLevel);
  metadata.dimension_names = {"z", "y", "x", "bound"};
  return metadata;
}

std::size_t range_chunk_bytes(ScalarType type) {
  return static_cast<std::size_t>(volume(kRangeChunkExtent)) * 2 * size_of(type);
}

std::uint32_t range_chunk_checksum(std::span<const std::byte> encoded) {
  // The checksum of all bytes, their own checksum among them, would always be the same.
  std::uint32_t crc = 0;
  if (encoded.size() >= sizeof crc) std::memcpy(&crc, encoded.last(sizeof crc).data(), sizeof crc);
  return crc;
}

void pack_ranges(ScalarType type, Box3 box, std::span<const std::byte> pairs, Int3 chunk, Box3 part,
                 std::span<std::byte> decoded) {
  const std::size_t pair = 2 * size_of(type);
  for_each_row(box, chunk, part, pair, [&](std::size_t to, std::size_t item, std::size_t count) {
    std::memcpy(decoded.data() + to, pairs.data() + item * pair, count * pair);
  });
}

void unpack_ranges(ScalarType type, std::span<const std::byte> decoded, Int3 chunk, Box3 part,
                   RangeTable& table) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    for_each_row(table.box, chunk, part, 2 * sizeof(T),
                 [&](std::size_t from, std::size_t item, std::size_t count) {
                   const std::byte* bytes = decoded.data() + from;
                   ValueRange<double>* to = table.ranges.data() + item;
                   for (std::size_t x = 0; x < count; ++x, ++to, bytes += 2 * sizeof(T)) {
                     T pair[2];
                     std::memcpy(pair, bytes, sizeof pair);
                     *to = {static_cast<double>(pair[0]), static_cast<double>(pair[1])};
                   }
                 });
  });
}

std::vector<std::uint32_t> with_own_checksum(std::vector<std::uint32_t> checksums) {
  checksums.push_back(crc32c(std::as_bytes(std::span(checksums))));
  return checksums;
}

std::optional<ChunkChecksums> parse_range_checksums(std::span<const std::byte> bytes,
                                                    std::size_t chunks) {
  if (bytes.size() != (chunks + 1) * sizeof(std::uint32_t)) return std::nullopt;
  ChunkChecksums read;
  read.chunks.resize(chunks);
  const auto own = bytes.last(sizeof read.own), rest = bytes.first(bytes.size() - own.size());
  std::memcpy(read.chunks.data(), rest.data(), rest.size());
  std::memcpy(&read.own, own.data(), own.size());
  if (crc32c(rest) != read.own) return std::nullopt;
  return read;
}

}  // namespace isobrick
